"""The list of measuring tools: one button each, with its own key."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from app.measure.placing import Kind, kinds
from app.theme.icons import icon
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.tool_key import add_tool_key
from gelpolight_core.translation import tr


class Palette(QWidget):
    """One button for each kind of tool. A second click deselects it.

    Parameters
    ----------
    owner : QWidget
        The keys work while it is visible.
    on_chosen : callable
        Called with the name of the kind; empty if none is chosen any more.
    """

    def __init__(self, owner: QWidget, on_chosen: Callable[[str], object]) -> None:
        super().__init__()
        named(self, "measure.palette", tr("Measuring tools"))
        self._on_chosen = on_chosen
        self.buttons: dict[str, QToolButton] = {}
        column = vbox(of=self, margins=0, spacing=2)
        for number, (_, group) in enumerate(groupby(kinds(), key=lambda kind: kind.group)):
            column.addSpacing(6 if number else 0)
            for kind in group:
                column.addWidget(self._make_button(kind, owner))

    def _make_button(self, kind: Kind, owner: QWidget) -> QToolButton:
        tip = f"{kind.label} ({kind.key})"
        button = named(QToolButton(), f"measure.tool.{kind.name}", kind.label, tip)
        button.setAutoRaise(True)
        button.setText(kind.label)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setIconSize(QSize(20, 20))
        button.setIcon(icon(f"tool-{kind.name}"))
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        button.setCheckable(True)
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        button.clicked.connect(lambda on, name=kind.name: self.choose(name if on else ""))
        add_tool_key(
            owner, kind.key, button.click, name=f"measure.key.{kind.name}", purpose=kind.label
        )
        self.buttons[kind.name] = button
        return button

    def choose(self, name: str) -> None:
        """Choose a kind. Empty: none."""
        for other, button in self.buttons.items():
            button.setChecked(other == name)
        self._on_chosen(name)
