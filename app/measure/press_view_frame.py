"""The widgets for measuring a press, and their layout."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QCheckBox,
    QDockWidget,
    QMainWindow,
    QMenu,
    QSplitter,
    QToolBar,
    QToolButton,
    QWidget,
)

from app.bench.bench_area import BenchArea
from app.context.context import AppContext
from app.live.banner import Banner
from app.live.depth import LiveDepth
from app.live.replay_bar import ReplayBar
from app.live.session import LiveSession
from app.measure.details import Details
from app.measure.side_panel import SidePanel
from app.measure.tool_map import ToolMap
from app.measure.work import Work
from app.services.jobs import Jobs
from app.widgets.actions import make_action
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.naming import named
from gelpolight_core.io.user import user_name
from gelpolight_core.translation import tr

FIRST_SIZES = [620, 300]


class PressViewFrame(QMainWindow):
    """The map with its tools, the side panel, the toolbar, and the virtual bench.

    Parameters
    ----------
    jobs : Jobs
        For long work.
    context : AppContext
        Shared by all pages.

    Signals
    -------
    freeze_pressed(), open_pressed(), propose_pressed(), keep_pressed()
        A button or key of the toolbar was pressed.
    """

    freeze_pressed = Signal()
    open_pressed = Signal()
    propose_pressed = Signal()
    keep_pressed = Signal()

    def __init__(self, jobs: Jobs, *, context: AppContext) -> None:
        super().__init__()
        named(self, "measure.press", tr("Measure a press"))
        self.setWindowFlags(Qt.WindowType.Widget)
        self.context = context
        self.work = Work(self)
        self.live = LiveSession(context=context, name="measure live", parent=self)
        self.depth = LiveDepth(self.live, jobs, self, context=context)
        idle = tr("Place a tool, or detect the object. Press Space to return to the camera.")
        self.banner = Banner(jobs, idle=idle)
        self.map = ToolMap(self.work)
        self.details = Details(jobs, settings=context.settings)
        self.replay = ReplayBar("measure")
        self.panel = SidePanel()
        self.panel.operator.setText(user_name())
        self.auto = named(
            QCheckBox(tr("Freeze when steady"), checked=True),
            "measure.auto",
            tr("Freeze the image and detect the object when a press is steady"),
        )
        self._build()

    def _build(self) -> None:
        self._split = named(QSplitter(Qt.Orientation.Vertical), "measure.split", tr("Views"))
        self._split.addWidget(self.map)
        self._split.addWidget(self.details)
        self._split.setStretchFactor(0, 1)
        self._split.setCollapsible(0, False)
        self._split.setSizes(FIRST_SIZES)
        middle = QWidget()
        across = hbox((self._split, 1), self.panel, spacing=0)
        vbox(self.banner, (across, 1), self.replay, of=middle, margins=0, spacing=0)
        self.setCentralWidget(middle)
        self._build_bar()
        self._bench = QDockWidget(tr("Virtual bench"), self)
        named(self._bench, "measure.bench", tr("Virtual bench"))
        self.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, self._bench)
        self._bench_area = BenchArea(self.context.source)
        self._bench.setWidget(scroll_area(self._bench_area))
        self._bench.hide()

    def _build_bar(self) -> None:
        bar = named(QToolBar(tr("Measure")), "measure.bar", tr("Measure"))
        bar.setMovable(False)
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self.freeze_action = make_action(
            self, "measure.hold", tr("Freeze"), self.freeze_pressed.emit, keys=("Space",),
            icon_name="hold", tip=tr("Freeze the image to measure on it, or continue"),
        )  # fmt: skip
        self.freeze_action.setCheckable(True)
        open_action = make_action(
            self, "measure.open", tr("Open image…"), self.open_pressed.emit, keys=("Ctrl+P",),
            icon_name="folder", tip=tr("Measure on an image from a file"),
        )  # fmt: skip
        stack = self.work.undo
        undo = make_action(
            self, "measure.undo", tr("Undo"), stack.undo, keys=("Ctrl+Z",), icon_name="undo",
        )  # fmt: skip
        redo = make_action(
            self, "measure.redo", tr("Redo"), stack.redo, keys=("Ctrl+Shift+Z", "Ctrl+Y"),
            icon_name="redo",
        )  # fmt: skip
        for action, can in ((undo, stack.canUndoChanged), (redo, stack.canRedoChanged)):
            action.setEnabled(False)
            can.connect(action.setEnabled)
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        groups = (
            (open_action,),
            (self.freeze_action, self.auto),
            (undo, redo),
            (self._views_button(),),
        )
        for number, group in enumerate(groups):
            if number:
                bar.addSeparator()
            for part in group:
                (bar.addAction if isinstance(part, QAction) else bar.addWidget)(part)
        for action in (undo, redo):
            bar.widgetForAction(action).setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonIconOnly)
        self.addToolBar(bar)
        make_action(
            self, "measure.propose", tr("Detect object"), self.propose_pressed.emit, keys=("Q",)
        )
        make_action(self, "measure.fit", tr("Whole map"), self.map.view.fit, keys=("F",))
        make_action(
            self, "measure.keep_result", tr("Save to records"), self.keep_pressed.emit,
            keys=("Ctrl+Return",),
        )  # fmt: skip

    def _views_button(self) -> QToolButton:
        """Return the button that shows the views next to the map."""
        button = named(
            QToolButton(), "measure.views", tr("Views"),
            tr("Show the section of a tool, or the tools in 3D and in the camera image"),
        )  # fmt: skip
        button.setText(tr("Views"))
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(button)
        details = self.details
        for name, text, part, keys in (
            ("surface", tr("3D"), details.surface, "Alt+1"),
            ("camera", tr("Camera"), details.camera, "Alt+3"),
            ("section", tr("Section"), details.section, "Alt+6"),
        ):
            menu.addAction(
                make_action(
                    self, f"measure.show_{name}", text,
                    lambda part=part: self._toggle_details(part), keys=(keys,),
                )
            )  # fmt: skip
        button.setMenu(menu)
        return button

    def restore(self) -> None:
        """Restore the saved sizes of the map and of the part below it."""
        self._split.restoreState(self.context.settings.layout("measure"))

    def keep_layout(self) -> None:
        """Save the sizes of the parts."""
        self.context.settings.keep_layout("measure", self._split.saveState())

    def _toggle_details(self, part: QWidget) -> None:
        there = self.details.isVisible() and self.details.currentWidget() is part
        self.details.open_at(part, not there)

    def follow_bench(self) -> None:
        """Show the bench next to the map if the virtual sensor is the camera."""
        self._bench.setVisible(self._bench_area.follow())
