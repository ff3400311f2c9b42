"""The refraction step: what the correction does to the contact of a press."""

from __future__ import annotations

from app.calibrate.balls.presenter import judge_ball
from app.calibrate.detection import read_raw
from app.calibrate.film_strip import Capture
from app.calibrate.image_area import IMAGE, RESULT
from app.calibrate.image_step import captures_of
from app.calibrate.maps import Panel
from app.calibrate.refraction.panels import refraction_panels
from app.calibrate.step import StepPresenter
from app.calibrate.step_data import Step
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class RefractionStep(StepPresenter):
    """Shows the most oblique press, or the selected one."""

    has_image_tab = False
    only_shows = True

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "refraction",
            tr("Refraction"),
            (Stage.BALLS,),
            tr(
                "Compare a press near the edge of the field before and after the correction. The "
                "ellipse of the contact must have become a circle."
            ),
            "ball",
        )

    def captures(self) -> tuple[Capture, ...]:
        """Return the ball presses."""
        project = self.model.project
        return captures_of(
            project.session, self.step.folder, lambda path: judge_ball(path.name, project)
        )

    def live(self) -> None:
        """Show the most oblique press."""
        super().live()
        self.show_result()

    def show_capture(self, name: str) -> None:
        """Show a press."""
        self.area.strip.choose(name)
        self.area.show_capture_name(name)
        self.model.show(name)
        self.show_result()

    def show_result(self) -> None:
        """Show the press before and after the correction, or say why that is not possible."""
        why = tr("The comparison needs the ball presses. Complete the earlier steps first.")
        panels: tuple[Panel, ...] = ()
        try:
            panels = self.result_panels()
        except InputError as error:
            why = str(error)
        self.area.maps.show_panels(panels, none=why)
        self.area.show_tab(RESULT, True)
        self.area.show_tab(IMAGE, False)

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the press before and after the correction; nothing without results."""
        results, folder = self.model.project.results, self.model.project.session.folder
        found = {ball.file: ball.press for ball in results.balls if ball.press is not None}
        if not found or results.table is None:
            return ()
        name = self.model.shown
        if name not in found:
            name = max(found, key=lambda n: sum(c * c for c in found[n].pose.centre_mm))
        raw = read_raw(folder / self.step.folder / name)
        return refraction_panels(raw, found[name], results.table)
