"""The background step: the membrane with nothing touching it."""

from __future__ import annotations

from dataclasses import replace

from app.calibrate.detection import (
    Detection,
    Detector,
    beside,
    enlarged,
    judged,
    marked,
    or_refusal,
    refuse_grey,
)
from app.calibrate.image_step import ImageStep
from app.calibrate.maps import Panel, three_maps
from app.calibrate.marks import table_of, working_circle
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb, saturated
from app.live.overlay import Overlay
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.calibration.open_sensor import BACKGROUND
from gelpolight_core.factors.bare_membrane import check_bare_membrane
from gelpolight_core.finding import Verdict
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.translation import tr


def detect_background(
    rgb: Rgb, *, table: ResamplingTable | None = None, whiteboard: Rgb | None = None
) -> Detection:
    """Check the bare membrane: well lit, not saturated, no contact.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    table : ResamplingTable, optional
        As for :func:`~app.calibrate.radiance.detect_whiteboard`.
    whiteboard : (rows, columns, 3), optional
        Image of the whiteboard stage; a press differs from it. Without it, contact is not checked.
    """
    circle = Overlay(lines=() if table is None else (working_circle(table),))

    def detect() -> Detection:
        refuse_grey(rgb)
        found = check_bare_membrane(rgb, table=table, whiteboard=whiteboard)
        compared = whiteboard is not None and whiteboard.shape == rgb.shape
        good = tr("The membrane is well lit and nothing touches it.")
        if not compared:
            good = tr("The membrane is well lit. Make sure nothing touches it, then click Capture.")
        marks = Overlay(
            lines=circle.lines, masks=marked(saturated(rgb) > 0, enlarged(found.pressed, rgb))
        )
        result = judged(marks, found.quality.figures, good)
        if result.good and not compared:  # nothing shows whether something touches it
            return replace(result, finding=replace(result.finding, verdict=Verdict.WARN))
        return result

    return or_refusal(detect, marks=circle)


class BackgroundStep(ImageStep):
    """Checks that the membrane is well lit and untouched."""

    step = step_of(
        BACKGROUND,
        tr("Mount the membrane, and let nothing touch it."),
        "membrane",
        frames=16,
        wanted=1,
        advice=tr(
            "Switch automatic exposure and white balance off, and do not change the exposure or "
            "the light afterwards."
        ),
    )

    def detector(self, name: str) -> Detector:
        """Return the check of the bare membrane."""
        project = self.model.project
        table = table_of(project.results)
        return beside(
            project.session.found("whiteboard"),
            lambda rgb, other: detect_background(rgb, table=table, whiteboard=other),
        )

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the reflectance factor of each LED."""
        results = self.model.project.results
        made, table = results.get(REFLECTANCE), table_of(results)
        if made is None or table is None:
            return ()
        found = made.factors
        return three_maps(found.factors, found.usable, table.grid, tr("Reflectance factor"))
