"""Buttons with text, icon, names and action, each in one expression."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QPushButton, QToolButton

from .icons import icon
from .widget_names import set_names

Slot = Callable[[], object]


def push_button(
    name: str, text: str, slot: Slot, *, icon_name: str = "", accessible: str = "", tip: str = ""
) -> QPushButton:
    """Return a push button.

    Parameters
    ----------
    name : str
        Object name, a dotted path.
    text : str
        On the button.
    slot : callable
        Called without arguments.
    icon_name : str, optional
        A name of :mod:`app.widgets.icons`.
    accessible : str, optional
        Text for screen readers. Default: that on the button.
    tip : str, optional
        Tooltip.
    """
    button = QPushButton(text)
    _finish(button, name, accessible or text, slot, icon_name, tip)
    return button


def tool_button(
    name: str, text: str, slot: Slot, *, icon_name: str = "", accessible: str = "", tip: str = ""
) -> QToolButton:
    """Return a flat button, see :func:`push_button`."""
    button = QToolButton()
    button.setText(text)
    button.setAutoRaise(True)
    _finish(button, name, accessible or text, slot, icon_name, tip)
    return button


def _finish(
    button: QPushButton | QToolButton,
    name: str,
    accessible: str,
    slot: Slot,
    icon_name: str,
    tip: str,
) -> None:
    if icon_name:
        button.setIcon(icon(icon_name))
    button.clicked.connect(lambda _checked=False: slot())
    set_names(button, name, accessible.replace("&", ""), tip)
