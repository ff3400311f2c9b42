"""Live check of the bare membrane, with the limits of the stage itself."""

from __future__ import annotations

from dataclasses import replace

from app.calibrate.detection import Detection, judged, or_refusal
from app.calibrate.light_checks import enlarged, marked, refuse_grey
from app.calibrate.marks import working_circle
from app.live.image_checks import Rgb, saturated
from app.live.overlay import Overlay
from gelpolight_core.factors.bare_membrane import check_bare_membrane
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
        As for :func:`~app.calibrate.radiance.detector.detect_whiteboard`.
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
            good = tr(
                "The membrane is well lit. Contact can be checked once the whiteboard has been "
                "captured."
            )
        marks = Overlay(
            lines=circle.lines, masks=marked(saturated(rgb) > 0, enlarged(found.pressed, rgb))
        )
        result = judged(marks, found.quality.figures, good)
        return result if compared else replace(result, warns=True)

    return or_refusal(detect, marks=circle)
