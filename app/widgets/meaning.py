"""Texts in the colour of what they mean; they follow the theme by themselves."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

PROPERTY = "meaning"
"""The property by which the program's style sheet chooses the colour."""


def show_meaning(widget: QWidget, meaning: str) -> None:
    """Colour a widget's text.

    Parameters
    ----------
    widget : QWidget
        A label, mostly.
    meaning : str
        One of :data:`app.shell.theme.MEANINGS`; empty: the colour of all other text.
    """
    if widget.property(PROPERTY) != meaning:
        widget.setProperty(PROPERTY, meaning)
        style = widget.style()
        style.unpolish(widget)
        style.polish(widget)


def make_bold(widget: QWidget, *, size: float = 1.0) -> None:
    """Show a widget's text bold, and larger by a factor."""
    font = widget.font()
    font.setPointSizeF(font.pointSizeF() * size)
    font.setBold(True)
    widget.setFont(font)
