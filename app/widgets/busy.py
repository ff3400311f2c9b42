"""A sign of work in progress."""

from __future__ import annotations

from PySide6.QtWidgets import QProgressBar

from app.widgets.layout import keep_space
from app.widgets.naming import named


def busy_bar(name: str, accessible: str) -> QProgressBar:
    """Return a thin bar that runs while it is visible, and keeps its space while it is not."""
    bar = named(QProgressBar(minimum=0, maximum=0, textVisible=False), name, accessible)
    bar.setFixedHeight(4)
    bar.hide()
    keep_space(bar)
    return bar
