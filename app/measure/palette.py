"""The palette of measuring tools: one button each, with its own key."""

from __future__ import annotations

from itertools import groupby

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QToolButton, QWidget

from app.measure.placing import Kind, kinds
from app.theme.icons import icon
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.tool_key import add_tool_key
from gelpolight_core.translation import tr

SIDE = 26


class Palette(QWidget):
    """One button for each kind of tool. A second click deselects it.

    Signals
    -------
    chosen(str)
        Name of the kind. Empty if none is chosen any more.
    """

    chosen = Signal(str)

    def __init__(self, owner: QWidget) -> None:
        super().__init__()
        named(self, "measure.palette", tr("Measuring tools"))
        self.buttons: dict[str, QToolButton] = {}
        column = vbox(of=self, margins=(4, 4, 4, 4), spacing=0)
        for number, (_, group) in enumerate(groupby(kinds(), key=lambda kind: kind.group)):
            column.addSpacing(8 if number else 0)
            for kind in group:
                column.addWidget(self._make_button(kind, owner))
        column.addStretch(1)

    def _make_button(self, kind: Kind, owner: QWidget) -> QToolButton:
        tip = f"{kind.label} ({kind.key})"
        button = named(QToolButton(autoRaise=True), f"measure.tool.{kind.name}", kind.label, tip)
        button.setIconSize(QSize(SIDE, SIDE))
        button.setIcon(icon(f"tool-{kind.name}"))
        button.setCheckable(True)
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        button.clicked.connect(lambda on, name=kind.name: self._on_clicked(name, on))
        add_tool_key(
            owner, kind.key, button.click, name=f"measure.key.{kind.name}", purpose=kind.label
        )
        self.buttons[kind.name] = button
        return button

    def deselect(self) -> None:
        """Choose none."""
        for button in self.buttons.values():
            button.setChecked(False)

    def _on_clicked(self, name: str, on: bool) -> None:
        for other, button in self.buttons.items():
            if other != name:
                button.setChecked(False)
        self.chosen.emit(name if on else "")
