"""The wizard's widgets and where they stand: steps, pictures, side panel, docks and bar."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QDockWidget,
    QHBoxLayout,
    QMainWindow,
    QStackedWidget,
    QToolBar,
    QUndoView,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.bench_dock import BenchDock
from app.calibrate.camera_link import CameraLink
from app.calibrate.controller import CalibrationController
from app.calibrate.outside import OutsideBar
from app.calibrate.pictures import Pictures
from app.calibrate.result_view import ResultView
from app.calibrate.setup_form import SetupForm
from app.calibrate.step_list import StepList
from app.calibrate.step_panel import StepPanel
from app.calibrate.steps import all_steps
from app.calibrate.validation_panel import ValidationPanel
from app.shell.actions import make_action
from app.shell.context import AppContext
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.naming import named
from app.widgets.source_button import SourceButton
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.translation import tr


class WizardFrame(QMainWindow):
    """The widgets of one session, without what they do.

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
        self.camera = CameraLink(self.controller.watching, context=context, parent=self)
        self.steps = all_steps()
        self.step = self.steps[0]
        self._build()
        self._build_docks()
        self._build_bar()

    @property
    def project(self) -> CalibrationProject:
        """The session's project."""
        return self.controller.project

    def _build(self) -> None:
        middle = QWidget()
        column = QVBoxLayout(middle)
        row = QHBoxLayout()
        for layout in (column, row):
            layout.setContentsMargins(0, 0, 0, 0)
            layout.setSpacing(0)
        self.outside = OutsideBar(self.controller)
        column.addWidget(self.outside)
        column.addLayout(row, 1)
        self.step_list = StepList(self.steps)
        self.pictures = Pictures()
        self.setup = SetupForm()
        self.result = ResultView(self.steps)
        self.curves: QWidget | None = None  # heavy: made when the step is first opened
        self.centre = QStackedWidget()
        for widget in (self.pictures, self.setup, self.result):
            self.centre.addWidget(widget)
        self.panel = StepPanel()
        self.validation = ValidationPanel(self.steps[-1])
        self.side = QStackedWidget()
        self.side.addWidget(self.panel)
        self.side.addWidget(self.validation)
        row.addWidget(self.step_list)
        row.addWidget(self.centre, 1)
        row.addWidget(self.side)
        self.setCentralWidget(middle)

    def _build_docks(self) -> None:
        self.history = QDockWidget(tr("History"), self)
        history = tr("History of captures and corrections")
        named(self.history, "calibrate.history", history)
        self._undo_view = named(QUndoView(self.controller.undo), "calibrate.history.list", history)
        self._undo_view.setEmptyLabel(tr("As opened"))
        self.history.setWidget(self._undo_view)
        self.bench_dock = BenchDock(self.context.source, self)
        for dock in (self.history, self.bench_dock):
            self.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, dock)
            dock.hide()

    def _build_bar(self) -> None:
        bar = QToolBar(tr("Session"), self)
        named(bar, "calibrate.bar", tr("Session"))
        bar.setMovable(False)
        bar.toggleViewAction().setEnabled(False)
        stack = self.controller.undo
        undo = make_action(self, "calibrate.undo", tr("Undo"), stack.undo, keys=("Ctrl+Z",))
        redo = make_action(
            self, "calibrate.redo", tr("Redo"), stack.redo, keys=("Ctrl+Shift+Z", "Ctrl+Y")
        )
        for action, can in ((undo, stack.canUndoChanged), (redo, stack.canRedoChanged)):
            action.setEnabled(False)
            can.connect(action.setEnabled)
        leave = make_action(
            self, "calibrate.leave", tr("Sessions"), self.left.emit,
            tip=tr("Leave this session; everything is saved"),
        )  # fmt: skip
        bar.addActions([leave, undo, redo])
        for dock, text in ((self.history, tr("History")), (self.bench_dock, tr("Virtual bench"))):
            action = dock.toggleViewAction()
            action.setText(text)
            action.setObjectName(f"{dock.objectName()}.shown")
            bar.addAction(action)
        for action in bar.actions():
            button = bar.widgetForAction(action)
            named(button, f"{action.objectName()}.button", action.text())
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        bar.addSeparator()
        source = SourceButton(
            context=self.context, page="calibrate", none=tr("No camera: import pictures")
        )
        bar.addWidget(source)
        session = self.project.session
        caption = PlainLabel(f"  {session.sensor.serial}  ·  {session.folder.name}  ")
        caption.setToolTip(plain_tip(str(session.folder)))
        bar.addWidget(caption)
        self.addToolBar(bar)
