"""The steps whose images are all light: mirror, white board, and the bare membrane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from app.live.image_checks import saturation_image
from app.live.overlay import ImageOverlay, OverlayMarker
from app.program.jobs import BackgroundJob
from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array, PixelArray, PointXY
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Verdict, judge
from gelpolight_core.calibration.image_checks import refuse_board
from gelpolight_core.calibration.open_ball_stages import REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import (
    BACKGROUND,
    LENS,
    LIGHTS,
    RADIANCE,
    TOP_POSE,
)
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.session import Session
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
from gelpolight_core.stages.leds.mirror_spots import find_mirror_spots, spot_near

from .detection_marks import (
    LED_ROLES,
    Detection,
    Detector,
    as_image,
    detect_or_refusal,
    judged_detection,
    mirror_positions_px,
    refuse_grey,
    share_of_area,
    spot_markers,
    spot_mask,
    suspect_masks,
    table_of,
    to_image_size,
    with_other_stage_image,
    working_circle,
)
from .image_panels import ImagePanel, led_panels
from .image_step import ImageStep

# A spot this far from its expected position cannot be explained by mounting tolerances.
LED_OFF_OF_WIDTH = 0.05


def detect_mirror(
    rgb: PixelArray,
    *,
    expected_px: Float64Array | None = None,
    editable: bool = False,
    boards: tuple[BoardSpec, ...] = (),
) -> Detection:
    """Find the reflections of the LEDs.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    expected_px : (3, 2), optional
        Expected positions of the spots, from
        :func:`app.calibrate.detection_marks.mirror_positions_px`.
    editable : bool, optional
        Whether the spots can be dragged; their handles are mirror.0, mirror.1 and mirror.2.
    boards : tuple of BoardSpec, optional
        Boards that may have been left in place of the mirror.
    """
    positions = () if expected_px is None else tuple(expected_px)
    rings = (
        OverlayMarker(float(u), float(v), "ring", "expected", text="expected") for u, v in positions
    )
    expected = ImageOverlay(tuple(rings))

    def detect() -> Detection:
        try:
            spots = find_mirror_spots(as_image(rgb))
        except InputError:
            refuse_board(as_image(rgb), boards, where="Image")
            raise
        masks = (spot_mask(rgb, *pair) for pair in zip(spots.spots, LED_ROLES, strict=True))
        marks = expected + ImageOverlay(spot_markers(spots, editable=editable), masks=tuple(masks))
        figures = spots.quality.figures
        if expected_px is not None:
            offset_px = float(np.linalg.norm(spots.centres_px - expected_px, axis=1).max())
            name, limit_px = "Largest spot offset", LED_OFF_OF_WIDTH * rgb.shape[1]
            remedy = "Check the channel of each LED, and that the mirror is flat"
            figures += (judge("spot_off_px", name, offset_px, "px", warn=limit_px, remedy=remedy),)
        return judged_detection(marks, figures, "All three LED reflections were found.")

    return detect_or_refusal(detect, marks=expected)


def placed_spots(rgb: PixelArray, session: Session) -> Detection:
    """Show the manually placed spots as handles that can be moved again."""

    def detect() -> Detection:
        spots = find_mirror_spots(as_image(rgb), placed=session.decisions.spots_px)
        marks = ImageOverlay(markers=spot_markers(spots, editable=True))
        return judged_detection(marks, spots.quality.figures, "The spots were placed by hand.")

    return detect_or_refusal(detect)


class LightsStep(ImageStep):
    """Finds the spots. The user can drag each of them."""

    of = LIGHTS
    guide = "guide/calibrate", "4-lights"
    task = "Lay the mirror on the top opening, with all LEDs on and the room dark."
    assembly = "mirror"
    frames, wanted, judges = 16, 1, ()
    advice = "Shorten the exposure until the three spots are small and not saturated."
    figure = "led_sd_mm"

    def detector(self, name: str) -> Detector:
        """Return the detection of the spots, with their positions in an earlier mirror image."""
        session, results = self.session, self.results
        if name and session.decisions.spots_px:
            return partial(placed_spots, session=session)
        expected = None
        lens, top, lights = results.get(LENS), results.get(TOP_POSE), results.get(LIGHTS)
        if lens and top and lights:
            plane, leds_mm = top.pose.plane, lights.leds.led_positions_mm
            expected = mirror_positions_px(lens.camera, plane, leds_mm)
        boards = session.top_pose, session.checkerboard
        return partial(detect_mirror, expected_px=expected, editable=bool(name), boards=boards)

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Move an LED's spot to the spot at this point, or to the point itself."""
        if not self.model.page.shown:
            return
        led, path = int(handle.removeprefix("mirror.")), self._path(self.model.page.shown)
        session = self.session
        job = BackgroundJob(
            "Analysing the image",
            lambda _progress: spot_near(session.image(path), (u, v)),
            lambda near: self.place_spot(led, near or (u, v)),
        )
        self.model.short_jobs.submit(job)

    def place_spot(self, led: int, position: PointXY | None) -> None:
        """Set the position of an LED's mirror spot by hand, with undo."""
        put, before = (
            partial(self.project.place_spot, led),
            self.session.decisions.spots_px.get(led),
        )
        self.model.correct("Move the mirror spot", put, position, before, "lights")


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
                text = "the image looks the same as the background image"
                raise InputError(text, "Image", Remedy.WITH_MEMBRANE)
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
        marks = circle + ImageOverlay(masks=masks)
        return judged_detection(marks, figures, "The whiteboard is well lit.")

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
        maps = light.radiance, light.usable, table.grid
        return led_panels(*maps, text, display, unit="%", factor=100.0)


def detect_background(
    rgb: PixelArray, *, table: ResamplingTable | None = None, whiteboard: PixelArray | None = None
) -> Detection:
    """Check the bare membrane: well lit, not saturated, no contact.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    table : ResamplingTable, optional
        As for :func:`~app.calibrate.light_steps.detect_whiteboard`.
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
        marks = circle + ImageOverlay(masks=masks)
        detection = judged_detection(marks, check.quality.figures, text)
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
    advice = "Switch automatic exposure and white balance off. Do not change the light afterwards."

    def result_panels(self) -> tuple[ImagePanel, ...]:
        """Return the reflectance factor of each LED."""
        reflectance, table = self.results.get(REFLECTANCE), table_of(self.results)
        if reflectance is None or table is None:
            return ()
        factors, display = reflectance.factors, self.context.display.value
        maps = factors.factors, factors.usable, table.grid
        return led_panels(*maps, "Reflectance factor", display)
