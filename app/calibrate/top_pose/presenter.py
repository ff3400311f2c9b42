"""The top surface step: a checkerboard on the top opening of the housing."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from app.calibrate.detection import Detector, too_early
from app.calibrate.image_step import WAITING, ImageStep, Judgement
from app.calibrate.step_data import Step
from app.calibrate.top_pose.detector import detect_top_pose
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.translation import tr


class TopPoseStep(ImageStep):
    """Finds the board with the lens of the step before."""

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "top_pose",
            tr("Top surface"),
            (Stage.TOP_POSE,),
            tr(
                "Mount the housing without the elastomer. Lay the small checkerboard flat on the "
                "top opening, pattern facing down."
            ),
            "board",
            frames=8,
            wanted=1,
        )

    def detector(self, name: str) -> Detector:
        """Return the detection of the board, once the lens is known."""
        project = self.model.project
        lens = project.results.lens
        if lens is None:
            return too_early
        board = project.session.top_pose
        return partial(detect_top_pose, board=board, camera=lens.camera, patient=bool(name))

    def judge(self, path: Path) -> Judgement:
        """Return whether a view is used."""
        return judge_top_view(path.name, self.model.project, self.model.statuses[self.stage])


def judge_top_view(name: str, project: CalibrationProject, status: StageStatus) -> Judgement:
    """Return how a view of the top surface was judged."""
    if status.state in (StageState.STALE, StageState.WAITING, StageState.EMPTY):
        return WAITING
    found = project.results.top_pose
    for view in () if found is None or not status.quality.figures else found.views:
        if view.name == name and not view.used:
            return Judgement("fail", view.reason, tr("not used"))
    return Judgement(status.state.value, status.sentence)
