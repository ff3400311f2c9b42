"""Names for widgets: one for tests and scripts, one for screen readers, a tip for everybody."""

from __future__ import annotations

from typing import TypeVar

from PySide6.QtWidgets import QWidget

from app.widgets.label import plain_tip

W = TypeVar("W", bound=QWidget)


def named(widget: W, name: str, accessible: str, tip: str = "") -> W:
    """Give a widget its names and return it.

    Parameters
    ----------
    widget : QWidget
        To be named.
    name : str
        A dotted path such as ``calibrate.capture``.
    accessible : str
        What a screen reader says.
    tip : str, optional
        What the pointer shows, where a word is not enough.
    """
    widget.setObjectName(name)
    widget.setAccessibleName(accessible)
    if tip:
        widget.setToolTip(plain_tip(tip))
    return widget
