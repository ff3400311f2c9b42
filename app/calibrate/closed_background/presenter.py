"""The background step of a closed sensor: the untouched membrane."""

from __future__ import annotations

from dataclasses import replace

from app.calibrate.background.detector import detect_background
from app.calibrate.detection import Detection, Detector
from app.calibrate.image_step import ImageStep
from app.calibrate.step_data import Step
from app.live.image_checks import Rgb
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.quality import QualityTable, Verdict
from gelpolight_core.translation import tr


class ClosedBackgroundStep(ImageStep):
    """Checks that the membrane is well lit."""

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "background",
            tr("Background"),
            (Stage.BACKGROUND,),
            tr(
                "Nothing must touch the membrane. Switch automatic exposure and white balance "
                "off, and do not change the exposure or the light afterwards."
            ),
            "membrane",
            frames=16,
            wanted=1,
        )

    def detector(self, name: str) -> Detector:
        """Return the check of the light; without other images contact cannot be seen."""
        return _check


def _check(rgb: Rgb) -> Detection:
    found = detect_background(rgb)
    if not found.ready or QualityTable(found.figures).verdict is not Verdict.PASS:
        return found
    text = tr("The membrane is well lit. Make sure nothing touches it, then click Capture.")
    return replace(found, sentence=text, warns=True)  # contact cannot be seen
