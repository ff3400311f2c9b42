"""The light intensity step: a white board on the elastomer, well lit and even."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import (
    Detection,
    Detector,
    Mask2,
    beside,
    enlarged,
    judged,
    marked,
    or_refusal,
    refuse_grey,
    share,
)
from app.calibrate.image_step import ImageStep
from app.calibrate.maps import Panel, three_maps
from app.calibrate.marks import table_of, working_circle
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb, saturated
from app.live.overlay import Overlay
from gelpolight_core.calibration.open_sensor import RADIANCE
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.factors.bare_membrane import (
    CHANGE,
    area_of,
    brightness_figure,
    is_same,
    local_change,
    saturated_percent,
    shrunk,
)
from gelpolight_core.finding import judge
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.radiance.whiteboard import LEAST_LIGHT
from gelpolight_core.translation import tr

Float = NDArray[np.float32]

# Specks and squares change the brightness within a fiftieth of the image; light does not.
SPECK_OF_WIDTH = 0.02


def detect_whiteboard(
    rgb: Rgb, *, table: ResamplingTable | None = None, background: Rgb | None = None
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
    circle = Overlay(lines=() if table is None else (working_circle(table),))

    def detect() -> Detection:
        refuse_grey(rgb)
        area, small = area_of(rgb.shape, table), shrunk(rgb)
        if background is not None and background.shape == rgb.shape:
            _refuse_membrane(small, shrunk(background), area)
        unlit = area & (small.min(axis=2) < LEAST_LIGHT)
        lit = area & ~unlit
        inner = _without_edge(lit)
        change = local_change(small, inner, SPECK_OF_WIDTH * small.shape[1])
        specks = inner & (change > CHANGE)
        full = saturated(rgb) > 0
        marks = Overlay(
            lines=circle.lines,
            masks=marked(full, enlarged(specks, rgb)),
        )
        figures = (
            brightness_figure(small, area),
            judge("saturated", tr("Saturated share"), saturated_percent(rgb, area), "%",
                  warn=0.1, fail=10.0,
                  remedy=tr("Shorten the exposure until nothing is saturated")),
            judge("unlit", tr("Unlit share"), 100.0 * share(unlit, area), "%", warn=10.0, fail=40.0,
                  remedy=tr("Press the board flat onto the surface, or lengthen the exposure")),
            judge("specks", tr("Specks and edges"), 100.0 * share(specks, area), "%",
                  warn=3.0, fail=20.0,
                  remedy=tr("Use a white board without pattern; clean it and the elastomer")),
            judge("light_range", tr("Ratio of brightest to darkest area"), _light_range(small, lit),
                  warn=40.0, remedy=tr("Dim or move the LEDs to get more even light")),
        )  # fmt: skip
        return judged(marks, figures, tr("The whiteboard is well lit."))

    return or_refusal(detect, marks=circle)


def _without_edge(lit: Mask2) -> Mask2:
    """Return the lit area without the mixed pixels at the edge of the board; specks stay in it."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    whole = cv2.morphologyEx(lit.astype(np.uint8), cv2.MORPH_CLOSE, disc)
    return np.asarray(cv2.erode(whole, disc, borderType=cv2.BORDER_REPLICATE)) > 0


def _light_range(small: Float, lit: Mask2) -> float:
    if not lit.any():
        return float("inf")
    inside = small[lit]
    return float((inside.max(axis=0) / np.percentile(inside, 1.0, axis=0)).max())


def _refuse_membrane(small: Float, background: Float, area: Mask2) -> None:
    """Raise InputError if the image shows the known bare membrane instead of the whiteboard."""
    if is_same(small, background, area):
        raise InputError(
            tr("the image looks the same as the background image"),
            where=tr("Image"),
            advice=Remedy.WITH_MEMBRANE,
        )


class RadianceStep(ImageStep):
    """Checks the light on the white board."""

    step = step_of(
        RADIANCE,
        tr("Press the white board onto the elastomer, without membrane and without air bubbles."),
        "whiteboard",
        frames=16,
        wanted=1,
        advice=tr(
            "Set the exposure so that nothing is saturated, and do not change it afterwards."
        ),
        figure="whiteboard_unlit_percent",
    )

    def detector(self, name: str) -> Detector:
        """Return the check of the light."""
        project = self.model.project
        table = table_of(project.results)
        return beside(
            project.session.found("background"),
            lambda rgb, other: detect_whiteboard(rgb, table=table, background=other),
        )

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the light intensity of each LED."""
        results = self.model.project.results
        found, table = results.get(RADIANCE), table_of(results)
        if found is None or table is None:
            return ()
        text = tr("Light intensity in percent of full scale")
        return three_maps(found.radiance, found.usable, table.grid, text, unit="%", factor=100.0)
