"""The list of measuring tools: one button each, with its own key."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from app.measure.placing import KINDS, Kind
from app.widgets.actions import icon_button, make_action
from app.widgets.layout import vbox
from app.widgets.naming import named


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
        named(self, "measure.palette", "Measuring tools")
        self._owner, self._on_chosen = owner, on_chosen
        self.group = QActionGroup(self)
        self.group.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)
        self.buttons: dict[str, QToolButton] = {}
        column = vbox(of=self, margins=0, spacing=2)
        for number, (_, group) in enumerate(groupby(KINDS, key=lambda kind: kind.group)):
            column.addSpacing(6 if number else 0)
            for kind in group:
                column.addWidget(self._make_button(kind))

    def _make_button(self, kind: Kind) -> QToolButton:
        action = make_action(
            self._owner,
            f"measure.tool.{kind.name}",
            kind.label,
            lambda: self._on_chosen(kind.name if action.isChecked() else ""),
            keys=(kind.key,),
            icon_name=kind.icon,
            checkable=True,
            inside=True,
        )
        self.group.addAction(action)
        button = self.buttons[kind.name] = icon_button(action)
        button.setAutoRaise(True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setIconSize(QSize(20, 20))
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        return button

    def clear(self) -> None:
        """Choose no kind."""
        if (chosen := self.group.checkedAction()) is not None:
            chosen.setChecked(False)
        self._on_chosen("")
