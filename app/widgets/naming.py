"""Names for controls: for tests and style sheets, for screen readers, and for the pointer."""

from __future__ import annotations

from typing import TypeVar

from PySide6.QtWidgets import QWidget

Named = TypeVar("Named", bound=QWidget)


def named(widget: Named, name: str, accessible: str, tip: str = "") -> Named:
    """Name a control and return it.

    Parameters
    ----------
    widget : QWidget
        The control.
    name : str
        Dotted path, such as ``calibrate.capture``.
    accessible : str
        What a screen reader says, translated.
    tip : str, optional
        What the pointer shows, translated; for whom a word is not enough.
    """
    widget.setObjectName(name)
    widget.setAccessibleName(accessible)
    widget.setToolTip(tip)
    return widget
