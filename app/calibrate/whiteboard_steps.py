"""The steps whose images are all light: a white board, then the bare membrane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from app.live.image_checks import saturation_image
from app.live.overlay import ImageOverlay
from gelpolight_core.base.arrays import BoolArray, Float32Array, PixelArray
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Verdict, judge
from gelpolight_core.calibration.open_ball_stages import REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND, RADIANCE
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.stages.flat_field.bare_membrane_check import (
    CHANGE,
    brightness_figure,
    check_bare_membrane,
    is_same,
    local_change,
    quarter_size,
    quarter_size_area,
    saturated_percent,
)
from gelpolight_core.stages.flat_field.whiteboard_stage import LEAST_LIGHT

from .detection_marks import (
    Detection,
    Detector,
    detect_or_refusal,
    judged_detection,
    refuse_grey,
    share_of_area,
    suspect_masks,
    table_of,
    to_image_size,
    with_other_stage_image,
    working_circle,
)
from .image_panels import ImagePanel, led_panels
from .image_step import ImageStep

# Specks and squares change the brightness within a fiftieth of the image; light does not.
SPECK_OF_WIDTH = 0.02


def detect_whiteboard(
    rgb: PixelArray, *, table: ResamplingTable | None = None, background: PixelArray | None = None
) -> Detection:
    """Check the light on the whiteboard.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    table : ResamplingTable, optional
        Gives the working area; without it the whole image is checked.
    background : (rows, columns, 3), optional
        Image of the background stage, if captured; it shows whether the membrane is still mounted.
    """
    circle = ImageOverlay(lines=() if table is None else (working_circle(table),))

    def detect() -> Detection:
        refuse_grey(rgb)
        area, small = quarter_size_area(rgb.shape, table), quarter_size(rgb)
        if background is not None and background.shape == rgb.shape:
            if is_same(small, quarter_size(background), area):  # of the known bare membrane
                raise InputError(
                    "the image looks the same as the background image",
                    "Image",
                    Remedy.WITH_MEMBRANE,
                )
        unlit_mask = area & (small.min(axis=2) < LEAST_LIGHT)
        lit_mask = area & ~unlit_mask
        inner_mask = _without_edge(lit_mask)
        change = local_change(small, inner_mask, SPECK_OF_WIDTH * small.shape[1])
        speck_mask = inner_mask & (change > CHANGE)
        masks = suspect_masks(saturation_image(rgb) > 0, to_image_size(speck_mask, rgb))
        shorten = "Shorten the exposure until nothing is saturated"
        press_flat = "Press the board flat onto the surface, or lengthen the exposure"
        clean = "Use a white board without pattern; clean it and the elastomer"
        even_out = "Dim or move the LEDs to get more even light"
        # In percent of the area.
        full = saturated_percent(rgb, area)
        unlit, specks = (100.0 * share_of_area(mask, area) for mask in (unlit_mask, speck_mask))
        light_ratio = _light_range(small, lit_mask)
        ratio_text = "Ratio of brightest to darkest area"
        figures = (
            brightness_figure(small, area),
            judge("saturated", "Saturated share", full, "%", warn=0.1, fail=10.0, remedy=shorten),
            judge("unlit", "Unlit share", unlit, "%", warn=10.0, fail=40.0, remedy=press_flat),
            judge("specks", "Specks and edges", specks, "%", warn=3.0, fail=20.0, remedy=clean),
            judge("light_range", ratio_text, light_ratio, warn=40.0, remedy=even_out),
        )
        return judged_detection(
            circle + ImageOverlay(masks=masks), figures, "The whiteboard is well lit."
        )

    return detect_or_refusal(detect, marks=circle)


def _without_edge(lit_mask: BoolArray) -> BoolArray:
    """Return the lit area without the mixed pixels at the edge of the board, but with specks."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    closed_mask = cv2.morphologyEx(lit_mask.astype(np.uint8), cv2.MORPH_CLOSE, disc)
    return np.asarray(cv2.erode(closed_mask, disc, borderType=cv2.BORDER_REPLICATE)) > 0


def _light_range(small: Float32Array, lit_mask: BoolArray) -> float:
    if not lit_mask.any():
        return float("inf")
    inside = small[lit_mask]
    return float((inside.max(axis=0) / np.percentile(inside, 1.0, axis=0)).max())


class LightStep(ImageStep):
    """Checks the light in an image, with the image of the other such step."""

    other: str
    """Folder of the other image, and name of the argument of `detect`."""
    detect: Callable[..., Detection]
    frames, wanted = 16, 1

    def detector(self, name: str) -> Detector:
        """Return the check of the light."""
        # The processing thread must not hold the step.
        detect, other, table = type(self).detect, self.other, table_of(self.results)
        return with_other_stage_image(
            self.session.found(other), lambda rgb, image: detect(rgb, table=table, **{other: image})
        )


class WhiteboardStep(LightStep):
    """Checks the light on the white board."""

    other, detect = "background", staticmethod(detect_whiteboard)
    of = RADIANCE
    guide = "guide/calibrate", "5-light-intensity"
    task = "Press the white board onto the elastomer, without membrane and without air bubbles."
    assembly = "whiteboard"
    advice = "Set the exposure so that nothing is saturated, and do not change it afterwards."
    figure = "whiteboard_unlit_percent"

    def result_panels(self) -> tuple[ImagePanel, ...]:
        """Return the light intensity of each LED."""
        light, table = self.results.get(RADIANCE), table_of(self.results)
        if light is None or table is None:
            return ()
        text = "Light intensity in percent of full scale"
        display = self.context.display.value
        return led_panels(
            light.radiance, light.usable, table.grid, text, display, unit="%", factor=100.0
        )


def detect_background(
    rgb: PixelArray, *, table: ResamplingTable | None = None, whiteboard: PixelArray | None = None
) -> Detection:
    """Check the bare membrane: well lit, not saturated, no contact.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    table : ResamplingTable, optional
        As for :func:`~app.calibrate.whiteboard_steps.detect_whiteboard`.
    whiteboard : (rows, columns, 3), optional
        Image of the whiteboard stage; a press differs from it. Without it, contact is not checked.
    """
    circle = ImageOverlay(lines=() if table is None else (working_circle(table),))

    def detect() -> Detection:
        refuse_grey(rgb)
        check = check_bare_membrane(rgb, table=table, whiteboard=whiteboard)
        has_whiteboard = whiteboard is not None and whiteboard.shape == rgb.shape
        text = "The membrane is well lit and nothing touches it."
        if not has_whiteboard:
            text = "The membrane is well lit. Make sure nothing touches it, then click Capture."
        masks = suspect_masks(saturation_image(rgb) > 0, to_image_size(check.pressed, rgb))
        detection = judged_detection(
            circle + ImageOverlay(masks=masks), check.quality.figures, text
        )
        if detection.good and not has_whiteboard:  # nothing shows whether something touches it
            return replace(detection, finding=replace(detection.finding, verdict=Verdict.WARN))
        return detection

    return detect_or_refusal(detect, marks=circle)


class BackgroundStep(LightStep):
    """Checks that the membrane is well lit and untouched."""

    other, detect = "whiteboard", staticmethod(detect_background)
    of = BACKGROUND
    guide = "guide/calibrate", "6-background"
    task = "Mount the membrane, and let nothing touch it."
    assembly = "membrane"
    advice = (
        "Switch automatic exposure and white balance off, and do not change the exposure or "
        "the light afterwards."
    )

    def result_panels(self) -> tuple[ImagePanel, ...]:
        """Return the reflectance factor of each LED."""
        reflectance, table = self.results.get(REFLECTANCE), table_of(self.results)
        if reflectance is None or table is None:
            return ()
        factors, display = reflectance.factors, self.context.display.value
        return led_panels(
            factors.factors, factors.usable, table.grid, "Reflectance factor", display
        )
