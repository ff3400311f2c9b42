"""Rows and columns of widgets, each in one expression."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QBoxLayout,
    QFrame,
    QHBoxLayout,
    QLayout,
    QScrollArea,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

Margins = int | tuple[int, int, int, int]


def hbox(
    *parts: Any,
    of: QWidget | None = None,
    margins: Margins | None = None,
    spacing: int | None = None,
) -> QHBoxLayout:
    """Return a row of widgets, see :func:`vbox`."""
    row = QHBoxLayout()
    _fill(row, parts, of, margins, spacing)
    return row


def vbox(
    *parts: Any,
    of: QWidget | None = None,
    margins: Margins | None = None,
    spacing: int | None = None,
) -> QVBoxLayout:
    """Return a column of widgets.

    Parameters
    ----------
    *parts : QWidget, QLayout, tuple or None
        From top to bottom. A tuple is a part with its stretch and alignment. None is a space that
        stretches, an int one of so many pixels.
    of : QWidget, optional
        The widget whose layout it is.
    margins : int or (left, top, right, bottom), optional
        Around all parts.
    spacing : int, optional
        Between two parts.
    """
    column = QVBoxLayout()
    _fill(column, parts, of, margins, spacing)
    return column


def _fill(
    box: QBoxLayout,
    parts: tuple[Any, ...],
    of: QWidget | None,
    margins: Margins | None,
    spacing: int | None,
) -> None:
    if of is not None:
        of.setLayout(box)
    if margins is not None:
        box.setContentsMargins(*((margins,) * 4 if isinstance(margins, int) else margins))
    if spacing is not None:
        box.setSpacing(spacing)
    for part in parts:
        item, *arguments = part if isinstance(part, tuple) else (part,)
        if item is None:
            box.addStretch(*(arguments or (1,)))
        elif isinstance(item, int):
            box.addSpacing(item)
        elif isinstance(item, QLayout):
            box.addLayout(item, *arguments)
        else:
            box.addWidget(item, *arguments)


def keep_space(widget: QWidget) -> None:
    """Keep the space of a widget while it is hidden, so that its neighbours do not move."""
    policy = widget.sizePolicy()
    policy.setRetainSizeWhenHidden(True)
    widget.setSizePolicy(policy)


def scroll_area(inside: QWidget) -> QScrollArea:
    """Return an area without a frame in which a widget scrolls up and down."""
    area = QScrollArea(widgetResizable=True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setWidget(inside)
    return area


def side_panel(parts: tuple[Any, ...], below: tuple[Any, ...], *, width: int = 280) -> QWidget:
    """Return a panel of fixed width: parts that scroll, and below them parts at a fixed place."""
    panel, inside, foot = QWidget(), QWidget(), QWidget()
    vbox(*parts, None, of=inside, margins=(16, 12, 12, 12), spacing=12)
    vbox(*below, of=foot, margins=(16, 8, 16, 12), spacing=8)
    vbox((scroll_area(inside), 1), foot, of=panel, margins=0, spacing=0)
    panel.setFixedWidth(width)
    return panel


def splitter(
    orientation: Qt.Orientation, *parts: tuple[QWidget, int], sizes: tuple[int, ...] = ()
) -> QSplitter:
    """Return widgets with movable borders between them, each with its stretch."""
    box = QSplitter(orientation, childrenCollapsible=False)
    for place, (widget, stretch) in enumerate(parts):
        box.addWidget(widget)
        box.setStretchFactor(place, stretch)
    if sizes:
        box.setSizes(list(sizes))
    return box
