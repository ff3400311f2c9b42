"""Widgets below a label of several lines do not move when its text changes."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.widgets.roomy_label import RoomyLabel


@pytest.mark.parametrize("text", ["One line.", "One line.\nAnd another."])
def test_nothing_moves_when_a_text_appears(text: str, qtbot: QtBot) -> None:
    """Otherwise the pointer would be over another part after a click on a button."""
    around = QWidget()
    qtbot.addWidget(around)
    column = QVBoxLayout(around)
    label, button = RoomyLabel("\n"), QPushButton("Save")
    for widget in (QWidget(), button, label):
        column.addWidget(widget, 0 if widget in (label, button) else 1)
    around.resize(400, 300)
    with qtbot.waitExposed(around):
        around.show()
    before = button.geometry()
    label.setText(text)
    column.activate()
    assert button.geometry() == before
