"""Measuring tools: a button for each kind, with its own key, and the list of those in use."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QSizePolicy, QToolButton, QWidget

from app.widgets.actions import icon_button, make_action
from app.widgets.icons import icon, tool_icon
from app.widgets.layout import vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import value_text
from gelpolight_core.measurement.tools.tool_base import PaletteEntry
from gelpolight_core.measurement.tools.tool_registry import PALETTE, palette_entry

from .measurement_model import MeasurementModel


class ToolPalette(QWidget):
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
        set_names(self, "measure.palette", "Measuring tools")
        self._owner, self._on_chosen = owner, on_chosen
        self.group = QActionGroup(self)
        self.group.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)
        self.buttons: dict[str, QToolButton] = {}
        column = vbox(of=self, margins=0, spacing=2)
        sections = groupby(PALETTE.items(), key=lambda item: item[1].section)
        for number, (_, entries) in enumerate(sections):
            column.addSpacing(6 if number else 0)
            for name, entry in entries:
                column.addWidget(self._make_button(name, entry))

    def _make_button(self, name: str, entry: PaletteEntry) -> QToolButton:
        action = make_action(
            self._owner,
            f"measure.tool.{name}",
            entry.label,
            lambda: self._on_chosen(name if action.isChecked() else ""),
            keys=(entry.key,),
            icon_name=tool_icon(name),
            tip=entry.tip,
            checkable=True,
            inside=True,
        )
        self.group.addAction(action)
        button = self.buttons[name] = icon_button(action)
        button.setAutoRaise(True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setIconSize(QSize(20, 20))
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        return button

    def clear(self) -> None:
        """Choose no kind."""
        if (action := self.group.checkedAction()) is not None:
            action.setChecked(False)
        self._on_chosen("")


class ToolList(QListWidget):
    """Lists the tools of `work`, each with its first figure. A click chooses one."""

    def __init__(self, work: MeasurementModel) -> None:
        super().__init__()
        set_names(self, "measure.tools", "Tools on the image")
        self._work = work
        self.setIconSize(QSize(16, 16))
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.itemClicked.connect(lambda item: work.choose(item.data(Qt.ItemDataRole.UserRole)))

    def refresh(self) -> None:
        """Show the present tools."""
        self.clear()
        for key, tool in self._work.sheet.items():
            answer = self._work.answer_of(key)
            value = "" if answer.refused else "…"
            if answer.result is not None:
                first = answer.result.figures[0]
                value = value_text(first.value, unit=first.unit)
            entry = palette_entry(tool.name)
            item = QListWidgetItem(icon(tool_icon(tool.name)), f"{entry.label} {value}")
            item.setData(Qt.ItemDataRole.UserRole, key)
            self.addItem(item)
            if key == self._work.chosen:
                self.setCurrentItem(item)
