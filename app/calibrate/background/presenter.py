"""The background step: the membrane with nothing touching it."""

from __future__ import annotations

from functools import partial

from app.calibrate.background.detector import detect_background
from app.calibrate.detection import Detection, Detector, or_refusal
from app.calibrate.image_step import ImageStep
from app.calibrate.light_checks import KnownImage
from app.calibrate.maps import Panel, three_maps
from app.calibrate.step_data import Step
from app.live.image_checks import Rgb
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.translation import tr


class BackgroundStep(ImageStep):
    """Checks that the membrane is well lit and untouched."""

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "background",
            tr("Background"),
            (Stage.BACKGROUND,),
            tr(
                "Mount the membrane. Nothing must touch it. Do not change the exposure or the "
                "light."
            ),
            "membrane",
            frames=16,
            wanted=1,
        )

    def detector(self, name: str) -> Detector:
        """Return the check of the bare membrane."""
        project = self.model.project
        known = KnownImage(project.session.found(FOLDERS[Stage.RADIANCE]))
        return partial(_check, table=project.results.table, known=known)

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the reflectance factor of each LED."""
        results = self.model.project.results
        found, table = results.factors, results.table
        if found is None or table is None:
            return ()
        return three_maps(found.factors, found.usable, table.grid, tr("Reflectance factor"))


def _check(rgb: Rgb, table: ResamplingTable | None, known: KnownImage) -> Detection:
    return or_refusal(lambda: detect_background(rgb, table=table, whiteboard=known.rgb))
