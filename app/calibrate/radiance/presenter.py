"""The light intensity step: a white board on the elastomer."""

from __future__ import annotations

from functools import partial

from app.calibrate.detection import Detection, Detector, or_refusal
from app.calibrate.image_step import ImageStep
from app.calibrate.light_checks import KnownImage
from app.calibrate.maps import Panel, three_maps
from app.calibrate.radiance.detector import detect_whiteboard
from app.calibrate.step_data import Step
from app.live.image_checks import Rgb
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.translation import tr


class RadianceStep(ImageStep):
    """Checks the light on the white board."""

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "radiance",
            tr("Light intensity"),
            (Stage.RADIANCE,),
            tr(
                "Insert the elastomer without the membrane. Press the white board onto it without "
                "air bubbles. Set the exposure so that nothing is saturated, and do not change it "
                "afterwards."
            ),
            "whiteboard",
            frames=16,
            wanted=1,
        )

    def detector(self, name: str) -> Detector:
        """Return the check of the light."""
        project = self.model.project
        known = KnownImage(project.session.found(FOLDERS[Stage.BACKGROUND]))
        return partial(_check, table=project.results.table, known=known)

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the light intensity of each LED."""
        results = self.model.project.results
        found, table = results.radiance, results.table
        if found is None or table is None:
            return ()
        text = tr("Light intensity in percent of full scale")
        return three_maps(found.radiance, found.usable, table.grid, text, unit="%", factor=100.0)


def _check(rgb: Rgb, table: ResamplingTable | None, known: KnownImage) -> Detection:
    return or_refusal(lambda: detect_whiteboard(rgb, table=table, background=known.rgb))
