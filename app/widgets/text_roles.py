"""Labels with names, and text coloured by its meaning. It follows the theme."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QStackedWidget, QWidget

from .label import PlainLabel
from .widget_names import set_names

PROPERTY = "meaning"
"""The property by which the program's style sheet selects the colour."""


def set_text_role(widget: QWidget, meaning: str) -> None:
    """Set the colour of a widget's text.

    Parameters
    ----------
    widget : QWidget
        Usually a label.
    meaning : str
        One of :data:`app.widgets.theme.MEANINGS`. Empty: the colour of normal text.
    """
    set_property(widget, PROPERTY, meaning)


def set_background_role(widget: QWidget, meaning: str) -> None:
    """Set text and background of a widget to pass, warn or fail. Empty: as usual."""
    set_property(widget, "ground", meaning)


def set_property(widget: QWidget, name: str, value: object) -> None:
    """Set a property that the style sheet selects by, and apply it."""
    if widget.property(name) != value:
        widget.setProperty(name, value)
        style = widget.style()
        style.unpolish(widget)
        style.polish(widget)


def make_bold(widget: QWidget, *, size: float = 1.0) -> None:
    """Make a widget's text bold, and larger by a factor."""
    font = widget.font()
    font.setPointSizeF(font.pointSizeF() * size)
    font.setBold(True)
    widget.setFont(font)


def heading(text: str, *, size: float = 1.0) -> PlainLabel:
    """Return a text in bold, in a multiple of the usual size."""
    label = PlainLabel(text)
    make_bold(label, size=size)
    return label


def named_label(
    name: str,
    accessible: str,
    *,
    text: str = "",
    wrap: bool = True,
    role: str = "",
    bold: float = 0.0,
) -> PlainLabel:
    """Return a label of plain text with its names.

    Parameters
    ----------
    name, accessible : str
        Object name, and text for screen readers.
    text : str, optional
        Text shown at first.
    wrap : bool, optional
        Whether long lines are wrapped.
    role : str, optional
        Meaning of the text, for its colour.
    bold : float, optional
        Size of bold letters, as a multiple of the usual size. 0: not bold.
    """
    label = set_names(PlainLabel(text, wrap=wrap), name, accessible)
    if bold:
        make_bold(label, size=bold)
    if role:  # a style sheet that is applied for nothing would take the font back later
        set_text_role(label, role)
    return label


def stack_over_text(name: str, text: str, widget: QWidget) -> QStackedWidget:
    """Return a stack of a centred text, shown as long as there is nothing, and a widget."""
    label = named_label(name, text, text=text)
    label.setAlignment(Qt.AlignmentFlag.AlignCenter)
    stack = QStackedWidget()
    stack.addWidget(label)
    stack.addWidget(widget)
    return stack
