"""The quality table: verdict as text and icon, advice where it is needed, no jumping rows."""

import math

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocumentFragment
from PySide6.QtWidgets import QApplication

from app.widgets.quality_table import QualityTableWidget
from gelpolight_core.base.finding import Finding, QualityTable, judge

RMS = {"unit": "px", "warn": 0.3, "fail": 1.0, "remedy": "Focus the camera"}
VIEWS = {"warn": 8, "fail": 4, "remedy": "Capture more views", "higher_is_better": True}


def table(rms: float, views: float) -> QualityTable:
    return QualityTable(
        (
            judge("rms", "Reprojection error", rms, **RMS),
            judge("views", "Views used", views, **VIEWS),
        )
    )


@pytest.fixture
def widget(qtbot):
    made = QualityTableWidget("test.quality", "Quality of the lens")
    qtbot.addWidget(made)
    made.resize(500, 200)
    made.show()
    return made


@pytest.mark.function("Read figures with limits, verdict and remedy of each stage")
def test_failing_figures_show_advice(widget):
    widget.set_table(table(0.5, 2))
    text = QTextDocumentFragment.fromHtml(widget.text()).toPlainText()
    order = "Warning", "Reprojection error", "Focus the camera.", "Fail", "Capture more views."
    assert [text.index(words) for words in order] == sorted(text.index(words) for words in order)


def test_its_text_can_be_copied_by_the_keyboard(widget, qtbot):
    widget.set_table(table(0.2, 16))
    with qtbot.waitActive(widget):
        widget.activateWindow()
    widget.setFocus()
    qtbot.keyClick(widget, Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier)
    qtbot.keyClick(widget, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    words = QApplication.clipboard().text().split()
    first, second = (
        "✓ Pass Reprojection error 0.2 px limit ≤ 0.3 px",
        "✓ Pass Views used 16 limit ≥ 8",
    )
    assert words == f"{first} {second}".split()


def test_a_figure_without_limits_has_no_verdict_and_limits_of_a_side_panel_follow_below(widget):
    widget.set_table(QualityTable((judge("distance", "Distance", 12.0, "mm"),)))
    shown = QTextDocumentFragment.fromHtml(widget.text()).toPlainText()
    assert shown.split() == ["Distance", "12", "mm"]
    narrow = QualityTableWidget.markup(table(0.2, 16), narrow=True)
    assert narrow.count("<td") == 2 * 3


def figure(value: float, **limits: object) -> Finding:
    return judge("key", "Label", value, **limits)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("shown", "output"),
    [
        (figure(math.nan), "unknown"),
        (figure(16.0), "16"),
        (figure(1.41e-16, unit="deg"), "0\N{DEGREE SIGN}"),
        (figure(12345.6, unit="px"), "12346 px"),
        (figure(0.00483, unit="%"), "0.00483 %"),
    ],
)
def test_values_are_written_as_people_write_them(shown, output):
    assert shown.value_text == output


@pytest.mark.parametrize(
    ("shown", "output"),
    [
        (figure(1.0), ""),
        (figure(1.0, unit="mm", fail=2.0), "≤ 2 mm"),
        (figure(3.0, warn=2.0), "≤ 2"),
        (figure(3.0, warn=2.0, higher_is_better=True), "≥ 2"),
        (figure(1.0, warn=2.0, higher_is_better=True), "≥ 2"),
        (figure(2.0, warn=2.0), "≤ 2"),
    ],
)
def test_limits_show_which_side_passes(shown, output):
    assert shown.limit_text == output
