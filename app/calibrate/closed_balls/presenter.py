"""The step of the ball presses on a closed sensor, with the benefit of one more press."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from app.calibrate.balls.presenter import BallsStep
from app.calibrate.closed_balls.detector import Untouched, detect_closed_ball, to_px
from app.calibrate.closed_balls.learning import Progress, progress_of, residual_panel
from app.calibrate.detection import Detector, sentence_of, too_early
from app.calibrate.image_step import WAITING, Judgement
from app.calibrate.maps import Panel
from app.calibrate.states import is_done
from app.calibrate.step_data import Step
from gelpolight_core.calibration.in_place_session import ENOUGH_BALLS, InPlaceRun
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.calibration.status import StageState
from gelpolight_core.in_place.calibrate import LEAST_PRESSES
from gelpolight_core.quality import QualityTable
from gelpolight_core.translation import tr

USUAL_MM_PER_PX = 0.06
ASKED = ("next_ball_gain_percent", "balls_used")
"""Figures whose advice is in the sentence about the next press."""


class ClosedBallsStep(BallsStep):
    """Asks for presses until more do not help."""

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "balls",
            tr("Ball presses"),
            (Stage.BALLS,),
            tr(
                "Press a ball of known diameter into the membrane, at a different place for each "
                "image. Its slopes must be as steep as what you want to measure. The ring in the "
                "image shows where the next press helps most."
            ),
            "ball",
            frames=4,
            wanted=ENOUGH_BALLS,
            least=LEAST_PRESSES,
        )

    def detector(self, name: str) -> Detector:
        """Return the detection of a pressed ball beside the background."""
        session = self.model.project.session
        files = session.found(FOLDERS[Stage.BACKGROUND])
        if not files:
            return too_early
        run = self._run()
        scale = session.mm_per_px or (run and run.result.model.grid.mm_per_px) or USUAL_MM_PER_PX
        detect = partial(
            detect_closed_ball,
            untouched=Untouched(files[-1], scale, session.response),
            radius_mm=self.radius.radius_mm,
        )
        if name or run is None:
            return detect
        grid = run.result.model.grid
        earlier = [to_px(x, y, grid) for _name, x, y, _c, _r in run.calibration.balls]
        return partial(detect, earlier_px=earlier, next_px=progress_of(run).next_px)

    def _run(self) -> InPlaceRun | None:
        """Return the calibration of the present presses."""
        state = self.model.statuses[Stage.BALLS].state
        stale = state in (StageState.EMPTY, StageState.WAITING, StageState.FAIL)
        return None if stale else self.model.project.results.run

    @property
    def progress(self) -> Progress | None:
        """Accuracy from the present presses; None without an up-to-date calibration."""
        run = self._run()
        present = self.model.statuses[Stage.BALLS].state is not StageState.STALE
        return progress_of(run) if run is not None and present else None

    def judge(self, path: Path) -> Judgement:
        """Return how well the other presses explain a press."""
        run = self._run()
        if run is None:
            return WAITING
        fault = run.result.refused.get(path.name)
        if fault is not None:
            return Judgement("fail", sentence_of(fault), tr("not used"))
        for press in run.result.presses:
            if press.name == path.name:
                error = press.held_out.normal_deg
                text = tr("Without this press, its normals are found with an error of {e:.1f} deg.")
                note = tr("{e:.1f} deg").format(e=error)
                return Judgement("pass", text.format(e=error), note, error)
        return WAITING

    @property
    def residual_heading(self) -> str:
        """The error of the normals of a press that the others predict."""
        return tr("Normal error, deg")

    def is_finished(self, state: str) -> bool:
        """Return whether more presses do not help."""
        progress = self.progress
        return is_done(state) and progress is not None and progress.settled

    def show_state(self, state: str, sentence: str) -> None:
        """Show the state, and the benefit of one more press."""
        progress = self.progress
        if progress is not None:
            figures = self.model.statuses[Stage.BALLS].quality.figures
            others = QualityTable(tuple(f for f in figures if f.key not in ASKED)).advice
            sentence = " ".join((progress.sentence(), *(f"{advice}." for advice in others)))
        super().show_state(state, sentence)

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the presses with their residuals."""
        run = self._run()
        return () if run is None else (residual_panel(run),)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the radius and the background."""
        found = self.model.project.session.found(FOLDERS[Stage.BACKGROUND])
        return (*super().depends_on(), found)
