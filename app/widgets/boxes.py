"""Rows and columns of widgets, filled in one call."""

from __future__ import annotations

from typing import TypeVar

from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QLayout, QVBoxLayout, QWidget

Part = QWidget | QLayout | int | tuple[QWidget | QLayout, int]
"""A widget or layout, alone or with its stretch; a number is empty space with that stretch."""
Box = TypeVar("Box", bound=QBoxLayout)
Margins = int | tuple[int, int, int, int]


def hbox(
    *parts: Part,
    parent: QWidget | None = None,
    margins: Margins | None = None,
    spacing: int | None = None,
) -> QHBoxLayout:
    """Return a row of parts.

    Parameters
    ----------
    *parts : Part
        From left to right.
    parent : QWidget, optional
        The widget whose layout it becomes.
    margins : int or (left, top, right, bottom), optional
        Around the parts, in pixels.
    spacing : int, optional
        Between the parts, in pixels.
    """
    return _filled(QHBoxLayout(), parts, parent, margins, spacing)


def vbox(
    *parts: Part,
    parent: QWidget | None = None,
    margins: Margins | None = None,
    spacing: int | None = None,
) -> QVBoxLayout:
    """Return a column of parts, as :func:`hbox`."""
    return _filled(QVBoxLayout(), parts, parent, margins, spacing)


def _filled(
    box: Box,
    parts: tuple[Part, ...],
    parent: QWidget | None,
    margins: Margins | None,
    spacing: int | None,
) -> Box:
    if parent is not None:
        parent.setLayout(box)
    if margins is not None:
        box.setContentsMargins(*((margins,) * 4 if isinstance(margins, int) else margins))
    if spacing is not None:
        box.setSpacing(spacing)
    for part in parts:
        item, stretch = part if isinstance(part, tuple) else (part, 0)
        if isinstance(item, int):
            box.addStretch(item)
        elif isinstance(item, QLayout):
            box.addLayout(item, stretch)
        else:
            box.addWidget(item, stretch)
    return box
