"""Shortcuts of tools that have a button but no action."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QWidget

PURPOSE = "purpose"
"""Property of a shortcut: its purpose, for the sheet of shortcuts."""


def add_tool_key(
    owner: QWidget, key: str, press: Callable[[], object], *, name: str, purpose: str
) -> QShortcut:
    """Make a key click a tool's button while the focus is inside a widget.

    Parameters
    ----------
    owner : QWidget
        The widget.
    key : str
        Key sequence as Qt writes it.
    press : callable
        The button's ``click``.
    name : str
        Object name. Its first part is the group on the sheet of shortcuts.
    purpose : str
        Text for the sheet of shortcuts.
    """
    shortcut = QShortcut(QKeySequence(key), owner)
    shortcut.setObjectName(name)
    shortcut.setProperty(PURPOSE, purpose)
    shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
    shortcut.activated.connect(press)
    return shortcut
