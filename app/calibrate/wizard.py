"""The wizard of one session: steps on the left, image in the middle, task on the right."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QTimer, Signal
from PySide6.QtWidgets import QApplication, QStackedWidget, QWidget

from app.calibrate.bench import BenchPart
from app.calibrate.image_area import ImageArea
from app.calibrate.model import WizardModel
from app.calibrate.moving_on import MovingOn
from app.calibrate.outside_changes import OutsideBar
from app.calibrate.session_camera import SessionCamera
from app.calibrate.states import OPEN, StepState
from app.calibrate.step import Parts, StepPresenter
from app.calibrate.step_list import StepColumn, StepList
from app.calibrate.step_panel import StepPanel
from app.calibrate.steps import route_of, steps_of
from app.context.context import AppContext
from app.widgets.actions import make_action
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.calibration.project import Project
from gelpolight_core.calibration.status import StageState
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class Wizard(QWidget):
    """Holds the steps of a session and passes on what concerns the open one.

    Parameters
    ----------
    project : Project
        The session.
    context : AppContext
        Context of the application.

    Signals
    -------
    left()
        The user wants to leave this session.
    renewed(str)
        The session needs other steps than before; with the key of the open one.
    """

    left = Signal()
    renewed = Signal(str)

    def __init__(self, project: Project, *, context: AppContext) -> None:
        super().__init__()
        named(self, "wizard", tr("Calibration wizard"))
        self.context = context
        self.model = WizardModel(project, context=context, parent=self)
        self.live = self.model.live
        self.outside = OutsideBar(self.model)
        self.area, self.panel = ImageArea(), StepPanel()
        route = route_of(project.recipe.of(project.session))
        steps = steps_of(route, self.model.statuses)
        self.step_list = StepList(steps)
        self.bench = BenchPart(context.source)
        self.column = StepColumn(self.step_list, self.bench, model=self.model, window=self)
        self.column.leave.triggered.connect(self.left)
        self._lay_out()
        parts = Parts(self.model, context, self.area, self.panel, steps)
        self.presenters: tuple[StepPresenter, ...] = tuple(make(parts) for make in route)
        self.open = self.presenters[0]
        for presenter in self.presenters:
            if self.centre.indexOf(presenter.centre) < 0:
                self.centre.addWidget(presenter.centre)
        self._running: object = None
        # Not at once: the history may ask for it, and is closed then.
        self._renewal = QTimer(self, singleShot=True, interval=0)
        self._renewal.timeout.connect(lambda: self.renewed.emit(self.open.step.key))
        self._build_keys()
        self.session_camera = SessionCamera(self.model, context=context, window=self)
        self.moving_on = MovingOn(self.model, self.panel, self.presenters, go_to=self.go_to)
        self._connect()
        self.refresh()
        for presenter in self.presenters:
            presenter.start()
        self.model.compute()

    def _lay_out(self) -> None:
        self.centre = QStackedWidget()
        self.centre.addWidget(self.area)
        row = hbox(self.column, (self.centre, 1), self.panel, margins=0, spacing=0)
        vbox(self.outside, (row, 1), of=self, margins=0, spacing=0)

    def _build_keys(self) -> None:
        self._capture_key = make_action(
            self, "calibrate.capture_now", tr("Capture"), lambda: self.open.capture(),
            keys=("C", "F5"),
        )  # fmt: skip
        self._live_key = make_action(
            self, "calibrate.live_again", tr("Back to the live image"), lambda: self.open.live(),
            keys=("Escape",),
        )  # fmt: skip
        make_action(self, "calibrate.next_step", tr("Next step"), self._next, keys=("Alt+Right",))
        make_action(
            self, "calibrate.previous_step", tr("Previous step"), lambda: self._go_by(-1),
            keys=("Alt+Left",),
        )  # fmt: skip

    def _connect(self) -> None:
        self.step_list.chosen.connect(lambda row: self.go_to(self.presenters[row].step.key))
        self._connect_open_step()
        panel, area, model = self.panel, self.area, self.model
        panel.next.clicked.connect(self._next)
        panel.automatic.setChecked(self.context.settings.preferences.captures_automatically)
        panel.automatic.toggled.connect(self._set_automatic)
        panel.cancel.clicked.connect(model.jobs.cancel)
        guide = self.context.requests.guide
        panel.help.guide.clicked.connect(lambda: guide.emit(*self.open.guide))
        area.reconnect.clicked.connect(self.live.open)
        area.view.clicked.connect(self._on_clicked)
        area.view.dragged.connect(self.bench.drag)
        area.view.refused.connect(self._refuse)
        area.view.saved.connect(
            lambda path: panel.show_notice(tr("Saved as {p}").format(p=path), "pass")
        )
        self.bench.opened.connect(self._follow_bench)
        for presenter in self.presenters:
            presenter.step_wanted.connect(self.go_to)
        model.shown_changed.connect(self._on_shown)
        model.changed.connect(self.refresh)
        model.changed.connect(self.outside.check)
        model.progressed.connect(self._show_progress)
        model.refused.connect(self._refuse)
        model.captured.connect(self._on_captured)
        model.photographed.connect(self._signal_capture)
        # A toast, not the panel: the user has already left the step.
        model.capture_aborted.connect(lambda text: self.context.toasts.show(text, "fail"))
        self.live.switched.connect(self._on_camera)
        self.live.lost.connect(area.show_lost)

    def _connect_open_step(self) -> None:
        """Pass on to the open step what the user does with the shared widgets."""
        panel, area = self.panel, self.area
        panel.capture.clicked.connect(lambda: self.open.capture())
        panel.import_files.triggered.connect(lambda: self.open.choose_files())
        panel.lay.clicked.connect(self._lay_on_bench)
        area.back_to_live.clicked.connect(lambda: self.open.live())
        area.strip.chosen.connect(self.show_capture)
        panel.repeat.clicked.connect(lambda: self.open.repeat(panel.worst))
        area.strip.excluded.connect(lambda name, out: self.open.exclude(name, out))
        area.view.moved.connect(lambda *at: self.open.moved(*at))
        self.live.processed.connect(lambda item: self.open.detected(item))

    # Called by the page

    def changeEvent(self, event: QEvent) -> None:
        """Redraw the icons in another theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "presenters"):
            # Not at once: Qt is iterating over all widgets, and none may be created or deleted
            # meanwhile. A zero timer would wait until there is nothing else to paint.
            QTimer.singleShot(1, self, self.refresh)

    def enter(self) -> None:
        """Open the camera when the wizard is shown."""
        self.session_camera.refer()
        self.live.enter(True)
        self.outside.watch(True)
        self._show_task()
        self._focus_on_what_comes_next()

    def leave(self) -> None:
        """Release the camera when the wizard is hidden."""
        self.moving_on.stop()
        self.live.enter(False)
        self.outside.watch(False)
        self.context.status.update(task="")

    def close_session(self) -> None:
        """Stop all work; all captures and decisions are on disk."""
        self._renewal.stop()
        for presenter in self.presenters:
            presenter.close()
        self.leave()
        # Later errors appear as toasts, because this page is gone.
        self.model.refused.disconnect(self._refuse)
        toasts = self.context.toasts
        self.model.refused.connect(lambda text: toasts.show(text, "fail"))
        self.model.close()

    # Steps

    @property
    def project(self) -> Project:
        """The session's project."""
        return self.model.project

    def at(self, key: str) -> StepPresenter:
        """Return a step by its key."""
        return next(one for one in self.presenters if one.step.key == key)

    def go_to(self, key: str) -> None:
        """Show a step."""
        left, self.open = self.open, self.at(key)
        if left is not self.open:
            left.leave()
        row = self.presenters.index(self.open)
        self.step_list.go_to(row)
        following = self.presenters[row + 1 : row + 2]
        self.panel.show_step(self.open.step, following=following[0].step.title if following else "")
        self._capture_key.setEnabled(self.open.step.captures)
        self.live.use(self.open.uses_camera)
        self.open.enter()
        self._compute_what_never_was()
        self.moving_on.enter(self.open)
        self._show_task()
        self.refresh()

    def _show_task(self) -> None:
        """Show in the state bar which sensor is calibrated, and which step is open."""
        if self.live.page_shown:
            n, count = self.presenters.index(self.open) + 1, len(self.presenters)
            self.context.status.update(
                sensor=self.model.project.session.serial,
                task=tr("Calibrating: {n} of {count}").format(n=n, count=count),
            )
        self.centre.setCurrentWidget(self.open.centre)
        self._focus_on_what_comes_next()

    def _next(self) -> None:
        """Show the next step, or say what is missing in this one."""
        if self.moving_on.just_moved:
            return
        obstacle = self.open.obstacle()
        if obstacle:
            self._refuse(obstacle)
        else:
            self._go_by(1)

    def _set_automatic(self, on: bool) -> None:
        self.context.settings.prefer(captures_automatically=on)

    def _go_by(self, steps: int) -> None:
        row = self.presenters.index(self.open) + steps
        if 0 <= row < len(self.presenters):
            self.go_to(self.presenters[row].step.key)

    def first_open_step(self) -> str:
        """Return the first step that is not complete."""
        states = self.model.states
        for presenter in self.presenters:
            step = presenter.step
            if step.stage is not None and states[step.key][0] in OPEN:
                return step.key
        last = [one.step.key for one in self.presenters if one.step.key in ("result", "validation")]
        tried = states[last[-1]][0] != StageState.EMPTY.value
        return last[-1] if self.model.saved and not tried else last[0]

    def _compute_what_never_was(self) -> None:
        """Compute a step's first result automatically; an outdated one waits for Recompute."""
        stages = self.open.step.stages
        if stages:
            ready = self.project.stale(upto=stages[-1])
            statuses = self.project.statuses()
            if not any(statuses[stage].state is StageState.STALE for stage in ready):
                self.model.compute(stages[-1])

    def _focus_on_what_comes_next(self) -> None:
        if self.isVisible():
            self.open.focus().setFocus()

    # State

    def refresh(self) -> None:
        """Show the present state of everything."""
        if self.project.statuses().keys() != self.model.statuses.keys():
            self._renewal.start()
            return
        self.model.update()
        self.model.states = self._states()
        self.step_list.show_states(self.model.states)
        self.open.refresh()
        self.moving_on.check()

    def _states(self) -> dict[str, StepState]:
        """Return state and message of every step; a waiting step names the one it waits for."""
        states: dict[str, StepState] = {}
        first_open = ""
        for presenter in self.presenters:
            step, (state, text) = presenter.step, presenter.state()
            empty = state == StageState.EMPTY.value and step.stage is None and bool(step.stages)
            if first_open and (empty or state == StageState.WAITING.value):
                text = tr("Waiting for {step}. Complete that step first.").format(step=first_open)
            if not first_open and step.stage is not None and state in OPEN:
                first_open = step.title
            states[step.key] = state, text
        return states

    def _show_progress(self, title: str, share: float) -> None:
        self.panel.show_work(title, share)
        running = self.model.running
        if not title or running is not self._running:
            self._running = running
            self.refresh()

    def _refuse(self, sentence: str) -> None:
        """Show an error message on the page."""
        self.outside.check()
        if self.isVisible():
            self.panel.show_notice(sentence, "fail")
        else:
            self.context.toasts.show(sentence, "fail")

    # Images

    def show_capture(self, name: str) -> None:
        """Show a capture with its detection."""
        try:
            self.open.show_capture(name)
        except InputError as error:
            self._refuse(str(error))

    def _on_shown(self) -> None:
        self._live_key.setEnabled(bool(self.model.shown))
        self._follow_bench()

    def _on_captured(self, stage: str, name: str) -> None:
        if self.open.step.stage == stage:
            self.open.captured(name)
            self.area.strip.show_newest()

    def _signal_capture(self, _stage: str) -> None:
        """Flash and beep: the user looks at the sensor and may now move it."""
        self.area.view.image.flash()
        if self.panel.automatic.isChecked():
            QApplication.beep()

    def _on_camera(self) -> None:
        self.bench.follow()
        self.panel.lay.setVisible(self.bench.in_use)
        self.open.camera_changed()

    # The virtual bench

    def _lay_on_bench(self) -> None:
        scene = self.bench.lay(self.open.step, self.project.session)
        if scene is not None:
            self.open.on_bench(scene)
            self.model.live_detection.count_movement()
            self.open.live()

    def _follow_bench(self) -> None:
        """Let drags move the object on the bench, if it is visible next to the live image."""
        live = not self.model.shown and self.bench.in_use
        self.area.view.image.hand_drags_on(live and self.bench.toggle.isChecked())

    def _on_clicked(self, u: float, v: float) -> None:
        if not self.model.shown:
            self.bench.drag_to(u, v)
