"""The wizard of one session: steps at the side, picture in the middle, what to do at the right."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QTimer
from PySide6.QtWidgets import QWidget

from app.calibrate.looking import Looking
from app.calibrate.maps import Panel
from app.calibrate.pictures import PICTURE, RESULT
from app.calibrate.saving import Saving
from app.calibrate.session_camera import SessionCamera, SetupCamera
from app.calibrate.standing import Standing
from app.calibrate.taking import Taking
from app.calibrate.trial import KnownObject
from app.calibrate.validating import Validating
from app.calibrate.wizard_frame import WizardFrame
from app.shell.actions import make_action
from app.shell.context import AppContext
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.status import StageState
from gelpolight_core.errors import InputError
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr


class Wizard(WizardFrame):
    """One session, from set-up to validation.

    Parameters
    ----------
    project : CalibrationProject
        The session.
    context : AppContext
        The program's.
    """

    def __init__(self, project: CalibrationProject, *, context: AppContext) -> None:
        super().__init__(project, context=context)
        self.looking = Looking(self.controller, self.pictures, self.panel, self.step)
        self.saving = Saving(self.controller, self.result, context=context)
        self.validating = Validating(self.controller, self.validation, context=context)
        self.taking = Taking(self, self.looking)
        self.standing = Standing(self, self.looking, self.validating)
        self._build_keys()
        self.session_camera = SessionCamera(self.controller, context=context)
        self.setup_camera = SetupCamera(self.setup, context=context)
        self._connect()
        self.standing.refresh()
        self.controller.look_for_boards()
        self.controller.compute()

    def _build_keys(self) -> None:
        self._capture_key = make_action(
            self, "calibrate.capture_now", tr("Capture"), self.taking.capture, keys=("C", "F5")
        )
        self._live_key = make_action(
            self, "calibrate.live_again", tr("Back to the live picture"),
            lambda: self.looking.live(), keys=("Escape",),
        )  # fmt: skip
        steps: tuple[tuple[str, str, int, str], ...] = (
            ("next_step", tr("Next step"), 1, "Alt+Right"),
            ("previous_step", tr("Previous step"), -1, "Alt+Left"),
        )
        for name, text, way, keys in steps:
            make_action(
                self, f"calibrate.{name}", text, lambda way=way: self._go_by(way), keys=(keys,)
            )

    def _connect(self) -> None:
        self.step_list.chosen.connect(lambda row: self.go_to(self.steps[row].key))
        panel, pictures, controller = self.panel, self.pictures, self.controller
        panel.next_wanted.connect(lambda: self._go_by(1))
        panel.cancel_wanted.connect(controller.jobs.cancel)
        panel.recompute_wanted.connect(self._recompute)
        panel.lay_wanted.connect(self._lay_on_bench)
        self.validation.lay_wanted.connect(self._lay_on_bench)
        pictures.strip.chosen.connect(self.look_at)
        pictures.live_wanted.connect(self.looking.live)
        pictures.reconnect_wanted.connect(self.camera.open)
        pictures.view.clicked.connect(self._on_clicked)
        pictures.view.dragged.connect(self.bench_dock.drag)
        self.bench_dock.visibilityChanged.connect(self._follow_bench)
        pictures.view.refused.connect(self._refuse)
        pictures.view.saved.connect(
            lambda path: self.panel.show_notice(tr("Saved {p}").format(p=path), "pass")
        )
        self.looking.looked.connect(self._on_looked)
        self.setup.accepted.connect(self._on_stated)
        self.result.step_wanted.connect(self.go_to)
        controller.changed.connect(self.standing.refresh)
        controller.progressed.connect(self.standing.show_progress)
        controller.refused.connect(self._refuse)
        # Not beside the step: whoever took the camera away has left it.
        controller.watching.given_up.connect(lambda text: self.context.toasts.show(text, "fail"))
        controller.changed.connect(self.outside.look)
        self.saving.saved.connect(self.validating.take)
        self.validating.show_pictures_in(self._show_trial)
        self.camera.switched.connect(self._on_camera)
        self.camera.lost.connect(pictures.show_lost)
        self.context.source.changed.connect(self.camera.open)

    # The page around

    def changeEvent(self, event: QEvent) -> None:
        """Draw the signs anew in another theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "standing"):
            # Not at once: Qt walks over all widgets, and none may be made or lost meanwhile. A
            # timer of no time at all would wait until nothing else is left to be painted.
            QTimer.singleShot(1, self, self.standing.refresh)

    def enter(self) -> None:
        """Look at the camera, as the wizard is shown."""
        self.session_camera.refer()
        self.camera.enter(True)
        self.outside.watch(True)
        self._focus_on_what_comes_next()

    def leave(self) -> None:
        """Let the camera go, as the wizard is hidden."""
        self.camera.enter(False)
        self.outside.watch(False)

    def close_session(self) -> None:
        """End all work; everything captured and decided is on disk."""
        self.panel.radius.interpretText()  # while it can still be kept
        self.context.source.changed.disconnect(self.camera.open)
        self.setup_camera.close()
        self.leave()
        self.validating.close()
        if self.curves is not None:
            self.curves.close_editor()
        # What could not be saved is told where it is seen when this page has gone.
        self.controller.refused.disconnect(self._refuse)
        toasts = self.context.toasts
        self.controller.refused.connect(lambda text: toasts.show(text, "fail"))
        if self.setup.edited:
            toasts.show(tr("What was changed in the set-up was not taken."), "warn")
        self.controller.close()

    def _on_camera(self) -> None:
        self.bench_dock.follow()
        for panel in (self.panel, self.validation):
            panel.lay.setVisible(self.bench_dock.in_use)
        self.validating.refresh()
        self.looking.camera_changed()

    def _lay_on_bench(self) -> None:
        scene = self.bench_dock.lay(self.step, self.project.session)
        if scene is None:
            return
        if self.step.stage is Stage.BALLS:
            self.looking.set_next_radius(0.5 * scene.size_mm)
        elif not self.step.folder:
            self.validation.show_known(KnownObject(scene.item, scene.size_mm, scene.depth_mm))
        self.looking.live()

    def _follow_bench(self) -> None:
        """Let drags move what lies on the bench, where it is shown beside the live picture."""
        live = not self.looking.name and self.bench_dock.in_use
        self.pictures.view.hand_drags_on(live and not self.bench_dock.isHidden())

    def _on_clicked(self, u: float, v: float) -> None:
        if not self.looking.name:
            self.bench_dock.drag_to(u, v)

    def _refuse(self, sentence: str) -> None:
        """Say on the page why something came to nothing."""
        self.outside.look()
        if self.isVisible() and self.side.currentWidget() is self.panel:
            self.panel.show_notice(sentence, "fail")
        else:
            self.context.toasts.show(sentence, "fail")

    # Steps

    def go_to(self, key: str) -> None:
        """Show a step."""
        left = self.step
        self.step = next(step for step in self.steps if step.key == key)
        row = self.steps.index(self.step)
        self.step_list.go_to(row)
        following = self.steps[row + 1].title if row + 1 < len(self.steps) else ""
        self.panel.show_step(self.step, following=following)
        self.side.setCurrentWidget(self.validation if key == "validation" else self.panel)
        if key == "setup" and not self.setup.edited:
            self.setup.show_session(self.project.session, new=False)
        self.pictures.strip.setVisible(self.step.stage is not None)
        self.pictures.show_tab(PICTURE, key != "refraction")
        self.pictures.show_tab(RESULT, False)
        self.pictures.tabs.setCurrentIndex(RESULT if key == "refraction" else PICTURE)
        self._capture_key.setEnabled(self.step.stage is not None and key != "refraction")
        self.looking.take_step(self.step)
        self.camera.use(self.looking.has_pictures or key == "validation")
        if left.key == "setup" and left is not self.step and self.setup.edited:
            text = tr("What was changed in the set-up is not taken yet: go back to it for that.")
            self.context.toasts.show(text, "warn")
        self._compute_what_never_was()
        self.standing.refresh()
        centre: dict[str, QWidget] = {"setup": self.setup, "result": self.result}
        self.centre.setCurrentWidget(centre.get(key, self.pictures))
        if key == "reflectance":
            self._show_curves()
        self._focus_on_what_comes_next()

    def _go_by(self, way: int) -> None:
        row = self.steps.index(self.step) + way
        if 0 <= row < len(self.steps):
            self.go_to(self.steps[row].key)

    def _compute_what_never_was(self) -> None:
        """Compute a step's first result unasked; a stale one waits for Recompute."""
        if not self.step.stages:
            return
        last = self.step.stages[-1]
        ready = self.project.stale(upto=last)
        statuses = self.controller.statuses()
        if not any(statuses[stage].state is StageState.STALE for stage in ready):
            self.controller.compute(last)

    def _focus_on_what_comes_next(self) -> None:
        if not self.isVisible():
            return
        first: dict[str, QWidget] = {
            "setup": self.setup.led_height,
            "result": self.result.save,
            "validation": self.validation.measure,
        }
        if self.looking.has_pictures and not self.panel.finished:
            panel = self.panel
            (panel.capture if panel.capture.isEnabled() else panel.import_files).setFocus()
        else:
            first.get(self.step.key, self.panel.next).setFocus()

    def _show_curves(self) -> None:
        from app.calibrate.curve_step import CurveStep  # heavy

        if self.curves is None:
            self.curves = CurveStep(self.controller)
            self.centre.addWidget(self.curves)
        self.curves.take_results()
        self.centre.setCurrentWidget(self.curves)

    # Pictures

    def look_at(self, name: str) -> None:
        """Show a capture with what was found in it."""
        try:
            self.looking.at(name)
        except InputError as error:
            self._refuse(str(error))

    def _on_looked(self) -> None:
        self._live_key.setEnabled(bool(self.looking.name))
        self._follow_bench()
        if self.step.key == "refraction":
            self.standing.show_refraction()

    def _on_stated(self, stated: Session) -> None:
        before = self.project.session
        self.controller.describe(stated)
        if self.project.session is before:
            return  # why is said already
        self.setup.show_session(self.project.session, new=False)
        self.panel.show_notice(tr("Taken. What rests on it is computed again."), "pass")

    def _recompute(self) -> None:
        self.controller.compute(self.step.stages[-1] if self.step.stages else None)

    def _show_trial(self, panel: Panel) -> None:
        """Show the depth of a validation's press."""
        if self.step.key == "validation":
            self.pictures.maps.show_panels((panel,))
            self.pictures.show_tab(RESULT, True)
            self.pictures.tabs.setCurrentIndex(RESULT)
