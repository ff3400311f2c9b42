"""Actions: what menus, buttons, shortcuts and the shortcut sheet share."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from app.shell.icons import icon
from app.widgets.label import plain_tip


def make_action(
    parent: QWidget,
    name: str,
    text: str,
    slot: Callable[[], object],
    *,
    keys: tuple[str, ...] = (),
    icon_name: str = "",
    tip: str = "",
) -> QAction:
    """Return an action of a widget; its shortcut works while the widget is shown.

    Parameters
    ----------
    parent : QWidget
        The action belongs to it and is added to it.
    name : str
        A dotted path; its first part is the action's group on the shortcut sheet.
    text : str
        With ``&`` before the letter for the keyboard.
    slot : callable
        Called without arguments.
    keys : tuple of str, optional
        Shortcuts such as ``Ctrl+O``.
    icon_name : str, optional
        A name of :mod:`app.shell.icons`.
    tip : str, optional
        What the pointer shows.
    """
    action = QAction(text, parent)
    action.setObjectName(name)
    action.setShortcuts(list(keys))
    if icon_name:
        action.setIcon(icon(icon_name))
    if tip:
        action.setToolTip(plain_tip(tip))
    action.triggered.connect(lambda _checked=False: slot())
    parent.addAction(action)
    return action
