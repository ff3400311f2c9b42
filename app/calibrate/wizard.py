"""The wizard of one session: steps at the side, picture in the middle, what to do at the right."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QDockWidget,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QMainWindow,
    QScrollArea,
    QStackedWidget,
    QTabWidget,
    QToolBar,
    QUndoView,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.controller import CalibrationController, Seen
from app.calibrate.detection import Detection
from app.calibrate.film_strip import FilmStrip
from app.calibrate.look import look_for, read_raw
from app.calibrate.maps import MapsView, Panel, panels_of, refraction_panels
from app.calibrate.result_view import ResultView
from app.calibrate.saving import Saving
from app.calibrate.setup_form import SetupForm
from app.calibrate.source_button import SourceButton
from app.calibrate.states import RUNNING, is_done, step_state
from app.calibrate.step_list import StepList
from app.calibrate.step_panel import StepPanel
from app.calibrate.steps import all_steps
from app.calibrate.takes import takes_of
from app.calibrate.trial import KnownObject
from app.calibrate.validating import Validating
from app.calibrate.validation_panel import ValidationPanel
from app.live.live_view import LiveView
from app.live.overlay import Overlay
from app.shell.actions import make_action
from app.shell.context import AppContext
from app.sources.processor import Failure, Outcome
from app.sources.source import Frame
from app.sources.stream import Stream
from app.widgets.naming import named
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject, StageState, StageStatus
from gelpolight_core.errors import InputError
from gelpolight_core.quality import QualityTable
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.session.session import Session
from gelpolight_core.translation import tr

STATUS_MS = 500
# After a capture by itself the technician has this long to arrange the next view.
PAUSE_S = 1.5


class Wizard(QMainWindow):
    """One session, from set-up to validation.

    Parameters
    ----------
    project : CalibrationProject
        The session.
    context : AppContext
        The program's.

    Signals
    -------
    left()
        The person wants another session.
    """

    left = Signal()

    def __init__(self, project: CalibrationProject, *, context: AppContext) -> None:
        super().__init__()
        self.setWindowFlags(Qt.WindowType.Widget)
        named(self, "wizard", tr("Calibration wizard"))
        self.context = context
        self.controller = CalibrationController(project, self)
        self.steps = all_steps()
        self.step = self.steps[0]
        self._looked_at = ""
        self._statuses: dict[Stage, StageStatus] = project.statuses()
        self._paused_until = 0.0
        self._tried = 0
        self._stream: Stream | None = None
        self._build()
        self._build_actions()
        self._connect()
        self.saving = Saving(self.controller, self.result, context=context)
        self.validating = Validating(self.controller, self.validation, context=context)
        self.saving.saved.connect(self.validating.take)
        self.validating.show_pictures_in(self._show_trial)
        self._status_tick = QTimer(self)
        self._status_tick.setInterval(STATUS_MS)
        self._status_tick.timeout.connect(self._show_figures)
        self._refresh()
        self.controller.compute()

    @property
    def project(self) -> CalibrationProject:
        """The session's project."""
        return self.controller.project

    # Building

    def _build(self) -> None:
        middle = QWidget()
        row = QHBoxLayout(middle)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        self.step_list = StepList(self.steps)
        self.view = LiveView()
        self.maps = MapsView()
        self.tabs = named(QTabWidget(), "calibrate.tabs", tr("Picture or result"))
        self.tabs.setDocumentMode(True)
        self.tabs.addTab(self.view, tr("Picture"))
        self.tabs.addTab(self.maps, tr("Result"))
        self.strip = FilmStrip()
        self.back_to_live = named(QLabel(), "calibrate.looking", tr("What is looked at"))
        pictures = QWidget()
        column = QVBoxLayout(pictures)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self.back_to_live)
        column.addWidget(self.tabs, 1)
        column.addWidget(self.strip)
        self.setup = SetupForm()
        self.result = ResultView(self.steps)
        self.curves = QWidget()  # replaced by the editor when the step is first opened
        self.centre = QStackedWidget()
        for widget in (pictures, self.setup, self.result, self.curves):
            self.centre.addWidget(widget)
        self._pictures = pictures
        self.panel = StepPanel()
        self.validation = ValidationPanel(self.steps[-1])
        self.side = QStackedWidget()
        self.side.addWidget(self.panel)
        self.side.addWidget(self.validation)
        row.addWidget(self.step_list)
        row.addWidget(self.centre, 1)
        row.addWidget(self.side)
        self.setCentralWidget(middle)
        self.history = QDockWidget(tr("History"), self)
        named(self.history, "calibrate.history", tr("History of corrections"))
        self._undo_view = QUndoView(self.controller.undo)
        self._undo_view.setEmptyLabel(tr("As captured"))
        self.history.setWidget(self._undo_view)
        self.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self.history)
        self.history.hide()
        self.bench_dock = QDockWidget(tr("Virtual bench"), self)
        named(self.bench_dock, "calibrate.bench", tr("Virtual bench"))
        self.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self.bench_dock)
        self.bench_dock.hide()

    def _build_actions(self) -> None:
        bar = QToolBar(tr("Session"), self)
        named(bar, "calibrate.bar", tr("Session"))
        bar.setMovable(False)
        bar.toggleViewAction().setEnabled(False)
        stack = self.controller.undo
        session = self.project.session
        self.caption = QLabel(f"  {session.sensor.serial}  ·  {session.folder.name}  ")
        self.caption.setToolTip(str(session.folder))
        for action in (
            make_action(
                self, "calibrate.leave", tr("Sessions"), self.left.emit,
                tip=tr("Leave this session; everything is saved"),
            ),
            make_action(self, "calibrate.undo", tr("Undo"), stack.undo, keys=("Ctrl+Z",)),
            make_action(
                self, "calibrate.redo", tr("Redo"), stack.redo, keys=("Ctrl+Shift+Z", "Ctrl+Y")
            ),
        ):  # fmt: skip
            bar.addAction(action)
        history = self.history.toggleViewAction()
        history.setText(tr("History"))
        bar.addAction(history)
        self.bench_action = self.bench_dock.toggleViewAction()
        self.bench_action.setText(tr("Virtual bench"))
        self.bench_action.setVisible(False)
        bar.addAction(self.bench_action)
        bar.addSeparator()
        self.camera = SourceButton(context=self.context)
        bar.addWidget(self.camera)
        bar.addWidget(self.caption)
        make_action(self, "calibrate.capture_now", tr("Capture"), self._capture, keys=("C", "F5"))
        make_action(self, "calibrate.next_step", tr("Next step"), self._next, keys=("Alt+Right",))
        make_action(
            self, "calibrate.previous_step", tr("Previous step"), self._previous,
            keys=("Alt+Left",),
        )  # fmt: skip
        make_action(
            self, "calibrate.live_again", tr("Back to the live picture"), self._look_live,
            keys=("Escape",),
        )  # fmt: skip
        self.addToolBar(bar)

    def _connect(self) -> None:
        self.step_list.chosen.connect(lambda row: self.go_to(self.steps[row].key))
        panel = self.panel
        panel.capture_wanted.connect(self._capture)
        panel.import_wanted.connect(self._import)
        panel.next_wanted.connect(self._next)
        panel.cancel_wanted.connect(self.controller.jobs.cancel)
        panel.recompute_wanted.connect(self._recompute)
        panel.radius.valueChanged.connect(self._on_radius)
        panel.lay_wanted.connect(self._lay_on_bench)
        self.validation.lay_wanted.connect(self._lay_on_bench)
        self.view.clicked.connect(self._on_clicked)
        self.strip.chosen.connect(self.look_at)
        self.strip.excluded.connect(self._on_excluded)
        self.view.moved.connect(self._on_moved)
        self.view.refused.connect(lambda text: self.context.toasts.show(text, "fail"))
        self.view.saved.connect(
            lambda path: self.context.toasts.show(tr("Saved {p}").format(p=path), "pass")
        )
        self.setup.accepted.connect(self._on_stated)
        self.result.step_wanted.connect(self.go_to)
        controller = self.controller
        controller.changed.connect(self._refresh)
        controller.captured.connect(self._on_captured)
        controller.detected.connect(self._on_detected)
        controller.progressed.connect(self._on_progress)
        controller.refused.connect(lambda text: self.context.toasts.show(text, "warn"))
        self.context.source.changed.connect(self._on_source)

    # The page around

    def enter(self) -> None:
        """Look at the camera, as the wizard is shown."""
        self._on_source()
        self._status_tick.start()

    def leave(self) -> None:
        """Let the camera go, as the wizard is hidden."""
        self._status_tick.stop()
        self._let_camera_go()

    def close_session(self) -> None:
        """End all work; everything captured and decided is on disk."""
        self.leave()
        if isinstance(self.curves, QWidget) and hasattr(self.curves, "close_editor"):
            self.curves.close_editor()
        self.controller.close()

    def _on_source(self) -> None:
        self._let_camera_go()
        info = self.context.source.info
        self._show_bench()
        if info is None:
            self.view.say(tr("No camera. Choose a source, or import pictures."))
            return
        self._stream = Stream(info.open())
        self._stream.start()
        self.controller.set_stream(self._stream)
        self.context.status.update(camera=info.name)
        if not self._looked_at:
            self.view.set_stream(self._stream)
        self._arm()

    def _show_bench(self) -> None:
        """Offer the virtual bench where the virtual sensor is the camera."""
        source = self.context.source
        virtual = source.info is not None and source.info.kind == "virtual"
        self.bench_action.setVisible(virtual)
        self.panel.lay.setVisible(virtual)
        self.validation.lay.setVisible(virtual)
        if not virtual or source.bench is None:
            self.bench_dock.hide()
        elif self.bench_dock.widget() is None:
            from app.bench.bench_panel import BenchPanel  # only the demo needs it

            scroll = QScrollArea()
            scroll.setWidgetResizable(True)
            scroll.setWidget(BenchPanel(bench=source.bench))
            self.bench_dock.setWidget(scroll)

    def _lay_on_bench(self) -> None:
        """Put on the virtual bench what this step asks for; each time the next view or press."""
        bench = self.context.source.bench
        if bench is None:
            return
        folder = self.step.folder or "presses"
        count = len(self.project.session.found(folder)) if self.step.folder else self._tried
        self._tried += not self.step.folder
        scene = bench.show(folder, count % bench.steps(folder))
        if self.step.stage is Stage.BALLS:
            self.panel.radius.setValue(0.5 * scene.size_mm)
        elif not self.step.folder:
            self.validation.show_known(KnownObject(scene.item, scene.size_mm, scene.depth_mm))
        self._look_live()

    def _on_clicked(self, u: float, v: float) -> None:
        """Move what lies on the virtual bench to where the person clicked in the live picture."""
        bench = self.context.source.bench
        if bench is not None and self.bench_dock.isVisible() and not self._looked_at:
            bench.drag_to(u, v)

    def _let_camera_go(self) -> None:
        self.controller.set_stream(None)
        self.view.set_stream(None)
        if self._stream is not None:
            self._stream.stop()
            self._stream = None
            self.context.status.update(camera=None, rate_hz=None, dropped=None, processing_ms=None)

    def _show_figures(self) -> None:
        if self._stream is None:
            return
        figures = self._stream.figures()
        self.context.status.update(
            rate_hz=figures.rate_hz,
            dropped=figures.dropped,
            processing_ms=self.controller.detection_ms,
        )
        if figures.lost:
            self.panel.show_live(figures.lost, ready=False)

    # Steps

    def first_open_step(self) -> str:
        """Return the first step that is not complete."""
        for step in self.steps:
            if step.stage is not None:
                state, _ = step_state(step, self._statuses, None)
                if state in (StageState.EMPTY.value, StageState.FAIL.value):
                    return step.key
        return "result"

    def go_to(self, key: str) -> None:
        """Show a step."""
        self.step = next(step for step in self.steps if step.key == key)
        row = self.steps.index(self.step)
        self.step_list.go_to(row)
        self.panel.show_step(self.step, last=row == len(self.steps) - 1)
        self.side.setCurrentWidget(self.validation if key == "validation" else self.panel)
        if key == "setup":
            self.setup.show_session(self.project.session, new=False)
        centre = {"setup": self.setup, "result": self.result}.get(key, self._pictures)
        if key == "reflectance":
            centre = self._curve_editor()
        self.centre.setCurrentWidget(centre)
        live = self.step.stage is not None or key == "validation"
        self.strip.setVisible(self.step.stage is not None)
        self.tabs.setTabVisible(0, live)
        self._look_live()
        self._refresh()
        if key == "refraction":
            self._show_refraction()

    def _next(self) -> None:
        row = self.steps.index(self.step)
        if row + 1 < len(self.steps):
            self.go_to(self.steps[row + 1].key)

    def _previous(self) -> None:
        row = self.steps.index(self.step)
        if row > 0:
            self.go_to(self.steps[row - 1].key)

    def _curve_editor(self) -> QWidget:
        """Return the reflectance curves' editor, made when it is first needed."""
        from app.calibrate.curve_step import CurveStep  # heavy

        if not isinstance(self.curves, CurveStep):
            editor = CurveStep(self.controller)
            self.centre.removeWidget(self.curves)
            self.curves.deleteLater()
            self.curves = editor
            self.centre.addWidget(editor)
        self.curves.take_results()
        return self.curves

    def _refresh(self) -> None:
        """Show how everything stands now."""
        self._statuses = self.controller.statuses()
        running = self.controller.running
        states = {s.key: step_state(s, self._statuses, running) for s in self.steps}
        states["setup"] = ("pass", tr("Stated"))
        states["validation"] = (
            self.validating.state if hasattr(self, "validating") else ("empty", "")
        )
        self.step_list.show_states(states)
        state, sentence = states[self.step.key]
        if state == RUNNING:
            sentence = tr("Computing from the captures.")
        quality = QualityTable()
        for stage in self.step.stages:
            quality = self._statuses[stage].quality
        stale = state in ("stale", "waiting") and not self.controller.jobs.busy
        self.panel.show_state(state, sentence, quality, stale=stale, done=is_done(state))
        self.strip.show_takes(
            takes_of(self.step, self.project, self._statuses, self.controller.lens_views())
        )
        self._count_captures()
        self.result.show_statuses(self._statuses, running)
        panels = panels_of(self.step.stages[0] if self.step.stages else None, self.project.results)
        if self.step.key not in ("refraction", "validation"):
            self.maps.show_panels(panels)
            self.tabs.setTabVisible(1, bool(panels))
        self._show_radius()
        self._arm()

    def _count_captures(self) -> None:
        """Say on the button how many captures there are, and how many make a good stage."""
        if self.step.stage is None:
            return
        count = len(self.project.session.found(self.step.folder))
        text = tr("&Capture")
        if self.step.wanted > 1:
            text = tr("&Capture  ({n} of {m})").format(n=count, m=max(self.step.wanted, count))
        elif count:
            text = tr("&Capture again")
        self.panel.capture.setText(text)

    # Pictures

    def _arm(self) -> None:
        """Let the detection look for what this step needs."""
        if self._looked_at or self.step.stage is None or self.step.key == "refraction":
            self.controller.look_with(None)
            if not self._looked_at:
                self.view.set_overlay(None)
            return
        looker = look_for(
            self.step,
            self.project,
            radius_mm=self.panel.radius.value(),
            views=self.controller.lens_views(),
        )
        self.controller.look_with(looker)

    def _look_live(self) -> None:
        """Show the live picture again."""
        self._looked_at = ""
        self.strip.clearSelection()
        self.strip.setCurrentRow(-1)
        self.back_to_live.setText("")
        self.back_to_live.hide()
        self.view.set_overlay(None)
        self.view.set_stream(self._stream)
        self.panel.show_live("", ready=True)
        self._show_radius()
        self._arm()

    def look_at(self, name: str) -> None:
        """Show a capture with what was found in it."""
        path = self.project.session.folder / self.step.folder / name
        try:
            raw = read_raw(path)
        except InputError as error:
            self.context.toasts.show(str(error), "fail")
            return
        self._looked_at = name
        self.view.set_stream(None)
        self.view.show_picture(raw)
        self.view.set_overlay(None)
        self.back_to_live.setText(
            tr("  Looking at {name}. Escape goes back to the live picture.").format(name=name)
        )
        self.back_to_live.show()
        self.controller.look_with(None)
        self._show_radius()
        if self.step.key == "refraction":
            self._show_refraction()
            return
        looker = look_for(
            self.step,
            self.project,
            radius_mm=self.panel.radius.value(),
            views=self.controller.lens_views(),
            name=name,
        )

        def done(found: Detection) -> None:
            if self._looked_at == name:
                self._show_detection(found)

        self.controller.analyse(lambda: looker(raw), done)

    def _show_detection(self, found: Detection) -> None:
        self.view.set_overlay(found.overlay)
        self.panel.show_live(found.sentence, ready=found.ready)

    def _on_detected(self, item: Any) -> None:
        if self._looked_at:
            return
        if isinstance(item, Failure):
            self.view.set_overlay(Overlay())
            self.panel.show_live(item.sentence, ready=False)
        elif isinstance(item, Outcome) and isinstance(item.value, Seen):
            self._show_detection(item.value.detection)
            self._capture_by_itself(item.frame, item.value)

    def _capture_by_itself(self, frame: Frame, seen: Seen) -> None:
        if (
            self.panel.automatic.isChecked()
            and seen.still
            and seen.detection.ready
            and frame.settled
            and not self.controller.capturing
            and time.monotonic() > self._paused_until
        ):
            self._paused_until = time.monotonic() + PAUSE_S
            self._capture()

    def _capture(self) -> None:
        if self.step.stage is None or self.step.key == "refraction":
            return
        if self._looked_at:
            self._look_live()
            return
        self.controller.next_radius_mm = self.panel.radius.value()
        self.controller.capture(self.step)

    def _on_captured(self, stage: str, name: str) -> None:
        del stage
        self.context.toasts.show(tr("Captured {name}").format(name=name), "pass")

    def _import(self) -> None:
        stage = self.step.stage
        if stage is None:
            return
        files, _ = QFileDialog.getOpenFileNames(
            self,
            tr("Import pictures"),
            str(self.context.settings.last_folder),
            tr("Pictures (*.png *.tif *.tiff)"),
        )
        if files:
            self.context.settings.last_folder = Path(files[0]).parent
            self.controller.import_files(stage, [Path(file) for file in files])

    def _on_excluded(self, name: str, excluded: bool) -> None:
        if self.step.stage is not None:
            self.controller.exclude(self.step.stage, name, excluded)

    def _on_moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        if not self._looked_at:
            return
        if handle.startswith("mirror."):
            path = self.project.session.folder / self.step.folder / self._looked_at
            self.controller.place_spot_near(int(handle.removeprefix("mirror.")), (u, v), path)
        elif handle == "ball":
            self.controller.place_ball(self._looked_at, PlacedCircle(u, v, radius_px))

    # Balls and set-up

    def _show_radius(self) -> None:
        if self.step.stage is not Stage.BALLS:
            return
        session = self.project.session
        default = session.ball_default_radius_mm or 3.0
        value = self.controller.next_radius_mm or default
        if self._looked_at:
            value = session.ball_radii_mm.get(self._looked_at, default)
        self.panel.radius.blockSignals(True)
        self.panel.radius.setValue(value)
        self.panel.radius.blockSignals(False)

    def _on_radius(self, radius_mm: float) -> None:
        if self._looked_at:
            self.controller.set_ball_radius(self._looked_at, radius_mm)
        else:
            self.controller.next_radius_mm = radius_mm
            self._arm()

    def _on_stated(self, stated: Session) -> None:
        self.controller.describe(stated)
        self.controller.compute()
        self.context.toasts.show(tr("Taken. What rests on these values is computed again."), "pass")

    def _recompute(self) -> None:
        self.controller.compute(self.step.stages[-1] if self.step.stages else None)

    def _on_progress(self, title: str, share: float) -> None:
        self.panel.show_work(title, share)
        if not title:
            self._refresh()

    def _show_trial(self, panel: Panel) -> None:
        """Show the depth of a validation's press."""
        if self.step.key == "validation":
            self.maps.show_panels((panel,))
            self.tabs.setTabVisible(1, True)
            self.tabs.setCurrentIndex(1)

    def _show_refraction(self) -> None:
        """Show the press that is most oblique, or the one chosen, before and after."""
        results = self.project.results
        found = {ball.file: ball.press for ball in results.balls if ball.press is not None}
        self.tabs.setTabVisible(0, False)
        if not found or results.table is None:
            self.maps.show_panels(())
            self.tabs.setTabVisible(1, False)
            return
        name = self._looked_at
        if name not in found:
            name = max(found, key=lambda n: sum(c * c for c in found[n].pose.centre_mm))
        raw = read_raw(self.project.session.folder / "balls" / name)
        self.maps.show_panels(refraction_panels(raw, found[name], results))
        self.tabs.setTabVisible(1, True)
