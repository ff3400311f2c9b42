"""The column at the left: the session's menu, the steps with their states, the virtual bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
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

from app.calibrate.bench import BenchPart
from app.calibrate.model import WizardModel
from app.calibrate.states import state_icon, state_word
from app.calibrate.step_data import Step
from app.widgets.actions import make_action
from app.widgets.dialog import Dialog, Kinds
from app.widgets.label import plain_tip
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 208
ROW = 36


class StepList(QListWidget):
    """The steps.

    Signals
    -------
    chosen(int)
        Index of the step that the user opens.
    """

    chosen = Signal(int)

    def __init__(self, steps: Sequence[Step]) -> None:
        super().__init__()
        named(self, "calibrate.steps", tr("Steps of the calibration"))
        self._steps = steps
        self.setProperty("plain", True)
        self.setIconSize(QSize(18, 18))
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Maximum)
        for step in steps:
            item = QListWidgetItem(step.title)
            item.setSizeHint(QSize(0, ROW))
            self.addItem(item)
        self.currentRowChanged.connect(self._on_row)

    def sizeHint(self) -> QSize:
        """Return a size that shows all steps."""
        return QSize(WIDTH, ROW * self.count() + 2 * self.frameWidth())

    def minimumSizeHint(self) -> QSize:
        """Return a size that shows some steps; the others are scrolled."""
        return QSize(0, 4 * ROW)

    def show_states(self, states: Mapping[str, tuple[str, str]]) -> None:
        """Show the state of each step: (state, message) by step key."""
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

    def go_to(self, row: int) -> None:
        """Mark a step as the open one, without emitting `chosen`."""
        with QSignalBlocker(self):
            self.setCurrentRow(row)

    def _on_row(self, row: int) -> None:
        if row >= 0:
            self.chosen.emit(row)


class StepColumn(QWidget):
    """The menu of the session above the steps, and below them the virtual bench.

    Parameters
    ----------
    steps : StepList
        The steps.
    bench : BenchPart
        The virtual bench.
    model : WizardModel
        Model of the wizard.
    window : QWidget
        The wizard; its actions work while it is visible.
    """

    def __init__(
        self, steps: StepList, bench: BenchPart, *, model: WizardModel, window: QWidget
    ) -> None:
        super().__init__()
        self._window, self._model = window, model
        session = model.project.session
        menu = named(
            QToolButton(popupMode=QToolButton.ToolButtonPopupMode.InstantPopup),
            "calibrate.session",
            tr("Session"),
            str(session.folder),
        )
        menu.setText(session.folder.name)
        menu.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        menu.setMenu(QMenu(menu))
        self.leave = make_action(
            window, "calibrate.leave", tr("&Sessions"), lambda: None,
            tip=tr("Leave this session; everything is saved"),
        )  # fmt: skip
        history = make_action(window, "calibrate.history", tr("&History"), self._show_history)
        menu.menu().addActions([self.leave, history])
        # Their menu is Edit.
        undo, redo = model.undo.undo, model.undo.redo
        make_action(window, "calibrate.undo", tr("Undo"), undo, keys=("Ctrl+Z",))
        make_action(window, "calibrate.redo", tr("Redo"), redo, keys=("Ctrl+Shift+Z", "Ctrl+Y"))
        bench.opened.connect(lambda on: self.setFixedWidth(bench.open_width + 16 if on else WIDTH))
        self.setFixedWidth(WIDTH)
        vbox(menu, steps, (bench, 1), None, of=self, margins=8, spacing=8)

    def _show_history(self) -> None:
        text = tr("History of captures and corrections")
        dialog = Dialog(self._window, "calibrate.history", text, Kinds.Close, once=True)
        view = named(QUndoView(self._model.undo), "calibrate.history.list", text)
        view.setEmptyLabel(tr("As opened"))
        dialog.fill(view)
        dialog.show()
