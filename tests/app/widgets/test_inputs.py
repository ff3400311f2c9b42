"""The mouse wheel scrolls a panel, and changes only the input that has the focus."""

import re
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QPointF
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QScrollArea, QVBoxLayout, QWidget

import app
from app.widgets.inputs import ComboBox, NumberField, Slider

INPUTS = {"QSpinBox", "QDoubleSpinBox", "QComboBox", "QSlider", "QDial"}


def combo_box() -> ComboBox:
    box = ComboBox()
    box.addItems(["one", "two", "three"])
    box.setCurrentIndex(1)
    return box


def turn_wheel(widget: QWidget) -> None:
    """Turn the wheel over a widget, as the window system does."""
    window = widget.window()
    at = widget.mapTo(window, QPointF(widget.rect().center()))
    QTest.wheelEvent(window.windowHandle(), at, QPoint(0, -120))
    QApplication.processEvents()


@pytest.mark.parametrize("make", [NumberField, combo_box, Slider])
def test_only_the_focused_input_follows_the_wheel(qtbot, make):
    panel, content, other, box = QScrollArea(), QWidget(), NumberField(), make()
    qtbot.addWidget(panel)
    layout = QVBoxLayout(content)
    for widget in (other, box, *(QLabel("text") for _ in range(60))):
        layout.addWidget(widget)
    panel.setWidget(content)
    panel.resize(200, 200)
    panel.show()
    panel.activateWindow()
    qtbot.waitExposed(panel)
    value = (lambda: box.currentIndex()) if isinstance(box, ComboBox) else (lambda: box.value())
    if not isinstance(box, ComboBox):
        box.setValue(10)
    other.setFocus()
    qtbot.waitUntil(other.hasFocus)
    before = value()
    turn_wheel(box)
    assert value() == before
    assert not box.hasFocus()
    assert panel.verticalScrollBar().value() > 0
    panel.verticalScrollBar().setValue(0)
    box.setFocus()
    qtbot.waitUntil(box.hasFocus)
    turn_wheel(box)
    assert value() != before
    assert panel.verticalScrollBar().value() == 0


def test_the_program_uses_no_other_inputs():
    folder = Path(app.__file__).parent
    for path in folder.rglob("*.py"):
        if path.name != "inputs.py":
            made = set(re.findall(r"(?<![\w.])(Q\w+)\(", path.read_text("utf-8")))
            assert not made & INPUTS, path
