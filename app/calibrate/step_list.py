"""The column at the left: the session's menu, the steps with their states, the virtual bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QSignalBlocker, QSize, Qt
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QListWidget,
    QListWidgetItem,
    QMenu,
    QSizePolicy,
    QToolButton,
    QUndoView,
    QWidget,
)

from app.program.context import SourceSelection
from app.source_ui.bench_panel import BenchArea
from app.sources.virtual_bench import BenchScene
from app.widgets.actions import make_action
from app.widgets.collapsible_section import CollapsibleSection
from app.widgets.dialog import Dialog, Kinds
from app.widgets.label import plain_tip
from app.widgets.layout import scroll_area, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.lab.press_folder import FOLDER as PRESSES

from .page_state import StepDeclaration, StepState, state_icon, state_word
from .step import Step
from .wizard_model import WizardModel

AREA_HEIGHT = 280


class BenchSection(QWidget):
    """Holds the bench panel, folded, and places on the bench the object that a step needs.

    Parameters
    ----------
    source : SourceSelection
        The source selection shared by all pages, with its bench.

    Attributes
    ----------
    toggle : QToolButton
        Opens or folds the panel.
    """

    def __init__(self, source: SourceSelection) -> None:
        super().__init__()
        set_names(self, "calibrate.bench", "Virtual bench")
        self._source = source
        self._area = BenchArea(source)
        self._scroll = scroll_area(self._area)
        self._scroll.setMinimumHeight(AREA_HEIGHT)
        fold = CollapsibleSection("calibrate.bench.shown", "Virtual bench", self._scroll)
        self.toggle = fold.title

        vbox((fold, 100), None, of=self, margins=0)
        self._laid: tuple[Step | None, BenchScene | None, int] = None, None, 0
        self._grab_offset: tuple[float, float] | None = None
        self.hide()

    @property
    def in_use(self) -> bool:
        """Whether the virtual sensor is the camera."""
        return self._source.virtual is not None

    @property
    def open_width(self) -> int:
        """Width that the open panel needs."""
        bar = self._scroll.verticalScrollBar()
        return self._area.minimumSizeHint().width() + bar.sizeHint().width()

    def follow(self) -> None:
        """Offer the bench only if the virtual sensor is the camera."""
        in_use = self._area.follow()
        self.setVisible(in_use)
        if not in_use:
            self.toggle.setChecked(False)

    def lay(self, step: Step) -> bool:
        """Place the object that a step needs, at the next view or press."""
        bench = self._source.bench
        if bench is None:
            return False
        folder = step.folder or PRESSES
        step.on_bench(bench.show(folder, step.placed() % bench.steps(folder)))
        self._laid = step, bench.scene, step.count()
        return True

    def goes_on(self, step: Step) -> bool:
        """Return whether an object placed for a step was captured, and was not moved since."""
        bench, (laid, scene, count) = self._source.bench, self._laid
        return bench is not None and (laid, scene) == (step, bench.scene) and step.count() > count

    def drag_to(self, u: float, v: float) -> None:
        """Move the object on the bench to the clicked point of the live image."""
        if self._source.bench is not None and self.toggle.isChecked():
            self._source.bench.drag_to(u, v)

    def drag(self, phase: str, u: float, v: float) -> None:
        """Move the object on the bench with a drag, keeping the grabbed point under the pointer.

        Parameters
        ----------
        phase : str
            "begin", "move" or "end".
        u, v : float
            Position of the pointer, image pixels.
        """
        bench = self._source.bench
        position = None if bench is None else bench.position_mm(u, v)
        if bench is None or position is None:
            return
        if phase == "begin":
            scene = bench.scene
            self._grab_offset = scene.x_mm - position[0], scene.y_mm - position[1]
        elif self._grab_offset is not None:
            dx_mm, dy_mm = self._grab_offset
            bench.set_scene(x_mm=position[0] + dx_mm, y_mm=position[1] + dy_mm)
            if phase == "end":
                self._grab_offset = None


WIDTH = 208
ROW = 36


class StepList(QListWidget):
    """The steps. Its `currentRowChanged` says which one the user opens."""

    def __init__(self, steps: Sequence[StepDeclaration]) -> None:
        super().__init__()
        set_names(self, "calibrate.steps", "Steps of the calibration")
        self._steps = steps
        self.setProperty("plain", True)
        self.setIconSize(QSize(18, 18))
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Maximum)
        for step in steps:
            item = QListWidgetItem(step.title)
            item.setSizeHint(QSize(0, ROW))
            self.addItem(item)

    def sizeHint(self) -> QSize:
        """Return a size that shows all steps."""
        return QSize(WIDTH, ROW * self.count() + 2 * self.frameWidth())

    def minimumSizeHint(self) -> QSize:
        """Return a size that shows some steps. The others are scrolled."""
        return QSize(0, 4 * ROW)

    def show_states(self, states: Mapping[str, StepState], place: int) -> None:
        """Show the state of each step by its key, and mark the open one."""
        for row, step in enumerate(self._steps):
            state, sentence = states.get(step.key, ("empty", ""))
            item = self.item(row)
            sign = state_icon(state).pixmap(self.iconSize(), self.devicePixelRatioF())
            icon = QIcon(sign)
            icon.addPixmap(sign, QIcon.Mode.Selected)  # the ground of the open step is no highlight
            item.setIcon(icon)
            item.setData(Qt.ItemDataRole.UserRole, state)
            item.setToolTip(plain_tip(f"{step.title}: {state_word(state)}. {sentence}".strip()))
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{step.title}, {state_word(state)}")
        with QSignalBlocker(self):
            self.setCurrentRow(place)


class StepColumn(QWidget):
    """The menu of the session above the steps, and below them the virtual bench.

    Parameters
    ----------
    steps : StepList
        The steps.
    bench : BenchSection
        The virtual bench.
    model : WizardModel
        Model of the wizard.
    window : QWidget
        The wizard; its actions work while it is visible.
    """

    def __init__(
        self, steps: StepList, bench: BenchSection, *, model: WizardModel, window: QWidget
    ) -> None:
        super().__init__()
        self._window, self._model = window, model
        session = model.project.session
        menu = set_names(
            QToolButton(popupMode=QToolButton.ToolButtonPopupMode.InstantPopup),
            "calibrate.session",
            "Session",
            str(session.folder),
        )
        menu.setText(session.folder.name)
        menu.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        menu.setMenu(QMenu(menu))
        tip = "Leave this session; everything is saved"
        self.leave = make_action(window, "calibrate.leave", "&Sessions", list, tip=tip)
        history = make_action(window, "calibrate.history", "&History", self._show_history)
        menu.menu().addActions([self.leave, history])
        bench.toggle.toggled.connect(
            lambda on: self.setFixedWidth(bench.open_width + 16 if on else WIDTH)
        )
        self.setFixedWidth(WIDTH)
        vbox(menu, steps, (bench, 1), None, of=self, margins=8, spacing=8)

    def _show_history(self) -> None:
        text = "History of captures and corrections"
        dialog = Dialog(self._window, "calibrate.history", text, Kinds.Close, once=True)
        view = set_names(QUndoView(self._model.undo), "calibrate.history.list", text)
        view.setEmptyLabel("As opened")
        dialog.fill(view)
        dialog.show()
