"""The wizard of one session: steps on the left, image in the middle, task on the right."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from PySide6.QtCore import QEvent, QTimer, Signal
from PySide6.QtWidgets import QApplication, QStackedWidget, QWidget

from app.program.context import AppContext
from app.widgets.actions import make_action, undo_actions
from app.widgets.layout import hbox
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration import closed_sensor_recipe, open_ball_stages, open_sensor_recipe
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.recipe import Stage
from gelpolight_core.calibration.stage_status import StageState

from .ball_steps import BallsStep
from .board_steps import LensStep, TopPoseStep
from .closed_sensor_steps import InPlaceBallsStep, ScaleStep
from .image_area import ImageArea
from .image_step import plain_step
from .light_steps import BackgroundStep, LightsStep, WhiteboardStep
from .page_state import BEGUN, UNJUDGED, UNRECORDED, PageState, is_done
from .result_step import ResultStep
from .setup_step import SetupStep
from .step import Step, resolve_page
from .step_list import BenchSection, StepColumn, StepList
from .step_panel import StepPanel
from .validation_step import ValidationStep
from .wizard_model import WizardModel

Route = tuple[type[Step], ...]

FIRST: Route = (SetupStep,)
LAST: Route = (ResultStep, ValidationStep)
"""Steps before and after those of the stages."""
PANELS: Mapping[Stage[Any], type[Step]] = {
    open_sensor_recipe.LENS: LensStep,
    open_sensor_recipe.TOP_POSE: TopPoseStep,
    open_sensor_recipe.LIGHTS: LightsStep,
    open_sensor_recipe.RADIANCE: WhiteboardStep,
    open_sensor_recipe.BACKGROUND: BackgroundStep,
    open_ball_stages.BALLS: BallsStep,
    closed_sensor_recipe.BACKGROUND: BackgroundStep,
    closed_sensor_recipe.SCALE: ScaleStep,
    closed_sensor_recipe.BALLS: InPlaceBallsStep,
}
"""The step of a stage. Another stage with images has one that only captures them."""


def route_of(stages: Iterable[Stage[Any]]) -> Route:
    """Return the route through stages of a recipe: what is known, the stages, and the result."""
    panels = (PANELS.get(stage) or plain_step(stage) for stage in stages if stage.folder)
    return (*FIRST, *panels, *LAST)


class Wizard(QWidget):
    """Holds the steps of a session and passes on what concerns the open one.

    Parameters
    ----------
    project : CalibrationProject
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

    def __init__(self, project: CalibrationProject, *, context: AppContext) -> None:
        super().__init__()
        set_names(self, "wizard", "Calibration wizard")
        self.context = context
        self.model = WizardModel(project, context=context, window=self)
        self.live = self.model.live
        self.area, self.panel = ImageArea(), StepPanel()
        route = route_of(project.recipe.of(project.session))
        self.steps = tuple(make(self.model, self.area, self.panel) for make in route)
        self.open: Step = self.steps[0]
        self.model.page = PageState(self.steps, self.open)
        self.step_list = StepList(self.steps)
        self.bench = BenchSection(context.source)
        column = StepColumn(self.step_list, self.bench, model=self.model, window=self)
        column.leave.triggered.connect(self.left)
        self.centre = QStackedWidget()
        self.centre.addWidget(self.area)
        hbox(column, (self.centre, 1), self.panel, of=self, margins=0, spacing=0)
        for step in self.steps:
            if self.centre.indexOf(step.centre) < 0:
                self.centre.addWidget(step.centre)
        self._running: object = None
        # Not at once: the history may ask for it, and is closed then.
        self._renewal = timer(self, 0, lambda: self.renewed.emit(self.open.key), once=True)
        self._build_keys()
        self._connect()
        self.refresh()
        self.model.compute()

    def _build_keys(self) -> None:
        undo_actions(self, "calibrate", self.model.undo)
        keys: dict[str, tuple[str, Callable[[], object], tuple[str, ...]]] = {
            "capture_now": ("Capture", lambda: self.open.capture(), ("C", "F5")),
            "live_again": ("Back to the live image", lambda: self.open.live(), ("Escape",)),
            "next_step": ("Next step", self._next, ("Alt+Right",)),
            "previous_step": ("Previous step", lambda: self._go_by(-1), ("Alt+Left",)),
        }
        self._keys = {
            name: make_action(self, f"calibrate.{name}", text, act, keys=keys)
            for name, (text, act, keys) in keys.items()
        }

    def _connect(self) -> None:
        self.step_list.currentRowChanged.connect(lambda row: self.go_to(self.steps[row].key))
        panel, area, model = self.panel, self.area, self.model
        panel.next.clicked.connect(self._next)
        panel.automatic.setChecked(self.context.settings.preferences.captures_automatically)
        prefer = self.context.settings.prefer
        panel.automatic.toggled.connect(lambda on: prefer(captures_automatically=on))
        panel.cancel.clicked.connect(model.stop)
        guide = self.context.requests.guide
        panel.help.guide.clicked.connect(lambda: guide.emit(*self.open.guide))
        area.reconnect.clicked.connect(self.live.open)
        area.view.image.clicked.connect(self._on_clicked)
        area.view.image.dragged.connect(self.bench.drag)
        area.view.refused.connect(self._refuse)
        area.view.saved.connect(lambda path: model.show_notice(f"Saved as {path}", "pass"))
        self.bench.toggle.toggled.connect(self._follow_bench)
        model.step_requested.connect(self.go_to)
        model.page_changed.connect(self._render)
        model.changed.connect(self.refresh)
        model.jobs.progressed.connect(self._show_progress)
        model.refused.connect(self._refuse)
        model.captured.connect(self._on_captured)
        model.photographed.connect(self._signal_capture)
        self.live.switched.connect(self._on_camera)
        self.live.lost.connect(lambda why: model.update_page(lost=why))
        # Actions of the user on the shared widgets concern the open step.
        # Not `clicked`, which an access key sends 0.1 s later, when another object may be pressed.
        panel.capture.pressed.connect(lambda: self.open.capture())
        panel.import_files.triggered.connect(lambda: self.open.choose_files())
        panel.lay.clicked.connect(self._lay_on_bench)
        area.back_to_live.clicked.connect(lambda: self.open.live())
        area.strip.chosen.connect(self.show_capture)
        panel.repeat.clicked.connect(lambda: self.open.repeat(model.page.worst_first[0].path.name))
        area.strip.excluded.connect(lambda name, out: self.open.exclude(name, out))
        area.view.moved.connect(lambda *at: self.open.moved(*at))
        self.live.processed.connect(lambda item: self.open.detected(item))

    # Called by the page

    def changeEvent(self, event: QEvent) -> None:
        """Redraw the icons in another theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_keys"):
            # Not at once: Qt is iterating over all widgets, and none may be created or deleted
            # meanwhile. A zero timer would wait until there is nothing else to paint.
            QTimer.singleShot(1, self, self.refresh)

    def enter(self) -> None:
        """Open the camera when the wizard is shown."""
        self.model.camera.refer()
        self.live.enter(True)
        self.refresh()  # the display may have changed on another page
        self._focus_on_what_comes_next()

    def leave(self) -> None:
        """Release the camera when the wizard is hidden."""
        self.live.enter(False)
        self.context.status.update(task="")

    def close_session(self) -> None:
        """Stop all work. All captures and decisions are on disk."""
        self._renewal.stop()
        for step in self.steps:
            step.close()
        self.leave()
        # Later errors appear as toasts, because this page is gone.
        self.model.refused.disconnect(self._refuse)
        self.model.refused.connect(partial(self.context.toasts.show, verdict="fail"))
        self.model.close()

    # Steps

    @property
    def project(self) -> CalibrationProject:
        """The session's project."""
        return self.model.project

    def at(self, key: str) -> Step:
        """Return a step by its key."""
        return next(step for step in self.steps if step.key == key)

    def go_to(self, key: str) -> None:
        """Show a step."""
        before, self.open = self.open, self.at(key)
        if before is not self.open:
            before.leave()
        page = self.model.page
        # The messages belong to the step before; they are removed, even during a computation.
        page_state = PageState(self.steps, self.open, page.states)
        shown = replace(page_state, camera=page.camera, lost=page.lost, work=page.work)
        self.model.show_page(shown)
        self._keys["capture_now"].setEnabled(self.open.frames > 0)
        self.live.use(self.open.frames > 0)
        self.open.enter()
        self._compute_what_never_was()
        self.centre.setCurrentWidget(self.open.centre)
        self._focus_on_what_comes_next()
        self.refresh()

    def _show_task(self) -> None:
        """Show the sensor and the open step in the state bar, at the end the calibration."""
        page = self.model.page
        if self.live.page_shown:
            task = f"Calibrating: {page.place + 1} of {len(self.steps)}"
            is_end = page.finished and not page.following
            serial = self.project.session.serial
            self.context.status.update(sensor=serial, task="" if is_end else task)

    def _next(self) -> None:
        """Show the next step, or say what is missing in this one."""
        if obstacle := self.open.obstacle():
            self._refuse(obstacle)
        else:
            self._go_by(1)

    def _go_by(self, steps: int) -> None:
        row = self.model.page.place + steps
        if 0 <= row < len(self.steps):
            self.go_to(self.steps[row].key)

    def first_open_step(self) -> str:
        """Return the first step that is not complete."""
        states = self.model.page.states
        for step in self.steps:
            if step.folder and step.needs_user(states[step.key][0]):
                return step.key
        tried = states["validation"][0] not in (StageState.EMPTY.value, BEGUN, UNRECORDED)
        ready = is_done(states["result"][0]) and self.model.saved and not tried
        return "validation" if ready else "result"

    def _compute_what_never_was(self) -> None:
        """Compute a step's first result automatically, unless the user has stopped it.

        An outdated one waits for Recompute.
        """
        if (stages := self.open.stages) and not self.model.stopped:
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
        statuses = self.project.statuses()
        if statuses.keys() != self.model.statuses.keys():
            self._renewal.start()
            return
        self.model.statuses = statuses
        self.model.show_page(resolve_page(self.model.page, self.steps, self.open))
        self.open.refresh()
        self._show_task()
        self._go_on_with_bench()

    def _render(self, before: PageState) -> None:
        """Draw what the page shows."""
        page = self.model.page
        if page.states is not before.states or page.step is not before.step:
            self.step_list.show_states(page.states, page.place)
        self.area.show_page(page, before)
        self.panel.show_page(page)
        self._keys["live_again"].setEnabled(bool(page.shown))
        if page.shown != before.shown:
            self._follow_bench()

    def _show_progress(self, title: str, share: float) -> None:
        self.model.update_page(work=(title, share))
        running = self.model.running
        if not title or running is not self._running:
            self._running = running
            self.refresh()

    def _refuse(self, sentence: str) -> None:
        """Show an error message on the page."""
        if self.isVisible():
            self.model.show_notice(sentence, "fail")
        else:
            self.context.toasts.show(sentence, "fail")

    # Images

    def show_capture(self, name: str) -> None:
        """Show a capture with its detection."""
        try:
            self.open.show_capture(name)
        except InputError as error:
            self._refuse(str(error))

    def _on_captured(self, stage: str, name: str) -> None:
        if self.open.folder and self.open.stages[0] == stage:
            self.open.captured(name)
            self.area.strip.show_newest()

    def _signal_capture(self) -> None:
        """Flash and beep: the user looks at the sensor and may now move it."""
        self.area.view.image.flash()
        if self.panel.automatic.isChecked():
            QApplication.beep()

    def _on_camera(self) -> None:
        self.bench.follow()
        self.panel.lay.setVisible(self.bench.in_use)
        self.model.update_page(camera=self.live.stream is not None)
        self.open.camera_changed()

    # The virtual bench

    def _lay_on_bench(self) -> None:
        self.open.live()
        if self.bench.lay(self.open):
            self.model.live_detection.count_movement()

    def _go_on_with_bench(self) -> None:
        """After an automatic capture, place the next view or press until the step is complete."""
        page = self.model.page
        is_due = page.state not in UNJUDGED and not (page.finished or page.shown)
        if is_due and self.panel.automatic.isChecked() and self.bench.goes_on(self.open):
            self._lay_on_bench()

    def _follow_bench(self) -> None:
        """Let drags move the object on the bench, if it is visible next to the live image."""
        live = not self.model.page.shown and self.bench.in_use
        self.area.view.image.hand_drags_on(live and self.bench.toggle.isChecked())

    def _on_clicked(self, u: float, v: float) -> None:
        if not self.model.page.shown:
            self.bench.drag_to(u, v)
