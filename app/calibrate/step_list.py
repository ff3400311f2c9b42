"""The list of steps at the side: the open step, the state of each; a click opens a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from app.calibrate.states import state_icon, state_word
from app.calibrate.step_data import Step
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 176


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
        self.setFixedWidth(WIDTH)
        self.setIconSize(QSize(18, 18))
        self.setSpacing(1)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        for number, step in enumerate(steps, start=1):
            item = QListWidgetItem(f"{number}  {step.title}")
            item.setSizeHint(QSize(WIDTH - 12, 34))
            self.addItem(item)
        self.currentRowChanged.connect(self._on_row)

    def show_states(self, states: Mapping[str, tuple[str, str]]) -> None:
        """Show the state of each step: (state, message) by step key."""
        for row, step in enumerate(self._steps):
            state, sentence = states.get(step.key, ("empty", ""))
            self._show_state(row, step, state, sentence)

    def _show_state(self, row: int, step: Step, state: str, sentence: str) -> None:
        item = self.item(row)
        item.setIcon(state_icon(state))
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
