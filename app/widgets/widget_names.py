"""Sets the names of widgets: object name for tests, accessible name for screen readers, tooltip."""

from __future__ import annotations

from typing import TypeVar

from PySide6.QtWidgets import QWidget

from .label import plain_tip

W = TypeVar("W", bound=QWidget)


def set_names(widget: W, name: str, accessible: str, tip: str = "", key: str = "") -> W:
    """Give a widget its names and return it.

    Parameters
    ----------
    widget : QWidget
        The widget.
    name : str
        Object name, a dotted path such as ``calibrate.capture``.
    accessible : str
        Text for screen readers.
    tip : str, optional
        Tooltip, if the visible text is not enough.
    key : str, optional
        Shortcut that the tooltip names.
    """
    widget.setObjectName(name)
    widget.setAccessibleName(accessible)
    if tip:
        widget.setToolTip(plain_tip(tip, key))
    return widget
