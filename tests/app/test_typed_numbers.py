"""A number that a person types is used as it is typed, or refused in words, in every field."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QLocale, QSignalBlocker, QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton, QToolTip, QVBoxLayout, QWidget

from app.inspect.depth_stream import StreamAddress
from app.inspect.export import export_dialog
from app.measure.inspector import ReferenceForm
from app.measure.page import IndentersDialog
from app.measure.press_state import PressState
from app.program.context import AppContext
from app.program.preferences import Preferences, WarningLimits
from app.source_ui.bench_panel import BenchPanel
from app.source_ui.camera_dialog import ControlRows
from app.source_ui.virtual_session import virtual_session
from app.sources.source import SourceSetting
from app.sources.virtual_bench import VirtualBench
from app.views.surface.scene_export import image_dialog
from app.widgets.dialog import Dialog
from app.widgets.forms import Form
from app.widgets.inputs import NumberField
from app.window.main_window import MainWindow
from gelpolight_core.session.description import create_session
from gelpolight_core.session.reference_object import LENGTHS, ReferenceObject
from gelpolight_core.simulation.sensor_design import SensorDesign

TYPED = ("4.87", "4,87", "0,0634", "1.234,5", "")
SYSTEMS = ("en_US", "de_DE")


@pytest.fixture(params=SYSTEMS)
def _system(request):
    """Make everything in a system of this language."""
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    yield
    QLocale.setDefault(before)
    QToolTip.hideText()


def places(context: AppContext, window: MainWindow) -> Iterator[QWidget]:
    """Return all pages with the steps of the wizard, and the panels and dialogs with numbers."""
    for name in window.entries:
        yield window.page(name)
    folder = context.workspace.sessions_folder("A-001") / "2026-01-02"
    create_session(replace(virtual_session(), folder=folder))
    page = window.page("calibrate")
    page.open_path(folder)
    for step in page.wizard.steps:
        page.wizard.go_to(step.key)
        yield page
    rows = ControlRows()
    rows.show_controls([SourceSetting("exposure_ms", "Exposure", "ms", 0.1, 200.0, 0.1, 8.0)])
    yield rows
    bench = VirtualBench(SensorDesign().scaled(0.25))
    bench.show("checkerboard", 0)
    yield BenchPanel(bench=bench)
    yield Form(StreamAddress(), "stream")
    ignored = lambda *_: None  # noqa: E731
    yield Form(Preferences(), "preferences")
    yield Form(WarningLimits(), "preferences")
    yield IndentersDialog((ReferenceObject("ball", 8.0, name="Ball"),), window)
    yield export_dialog(Path("out"), ignored, count=9, parent=window)
    yield image_dialog(QSize(800, 600), ("view",), ignored, window)


def update(field: NumberField) -> None:
    """Let the program show its state again, as it does while one types."""
    above = field.parentWidget()
    while above is not None and not isinstance(above, Form):
        above = above.parentWidget()
    if above is not None:
        above.show_value(above.value)
    with QSignalBlocker(field):
        field.setSuffix(field.suffix())
        field.setRange(field.minimum(), field.maximum())
        field.setValue(field.value())


def check(field: NumberField, text: str) -> None:
    """Type a text key by key into a field, and compare what becomes of it."""
    before = field.value()
    field.selectAll()
    QTest.keyClick(field, Qt.Key.Key_Delete)
    for at, key in enumerate(text):
        QTest.keyClicks(field, key)
        update(field)
        assert field.cleanText() == text[: at + 1]
    QTest.keyClick(field, Qt.Key.Key_Return)
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = None
    if not text and not field.refused:  # the text of the lowest value, as "not known"
        assert field.value() == field.minimum()
        assert field.text() == field.specialValueText() != ""
    elif field.refused:
        assert field.value() == before
        assert field.cleanText() == text
        assert text in field.refused
        if value is not None:
            inside = field.minimum() <= value <= field.maximum()
            assert not inside or round(value, field.decimals()) != value
    else:
        assert field.value() == value
        shown = f"{value:.{field.decimals()}f}"
        assert field.text() in (f"{shown}{field.suffix()}", field.specialValueText())
    field.setValue(field.minimum() if before != field.minimum() else field.maximum())
    field.setValue(before)
    assert not field.refused


@pytest.mark.function("Type a number with a point or a comma into any field")
def test_every_number_field_takes_a_point_or_a_comma_and_loses_no_key(context, qtbot):
    window = MainWindow(context=context)
    qtbot.addWidget(window)
    seen: dict[str, NumberField] = {}
    for place in places(context, window):
        qtbot.addWidget(place)
        for field in place.findChildren(NumberField):
            if field.objectName() not in seen and field.isEnabledTo(place):
                seen[field.objectName()] = field
                for system in SYSTEMS:
                    field.setLocale(QLocale(system))
                    for text in TYPED:
                        check(field, text)
    kinds = {name.partition(".")[0] for name in seen}
    assert kinds >= {
        "setup", "measure", "validation", "calibrate", "inspect", "preferences",
        "bench", "camera", "stream", "view3d",
    }  # fmt: skip
    window.close()
    QToolTip.hideText()


@pytest.mark.usefixtures("_system")
def test_the_reference_stays_as_typed_while_the_tool_is_measured_again(qtbot):
    states = PressState(
        frozen=True, earlier=False, measurable=True, freezable=True, reconstructing=False,
        detecting=False, kind="cylinder",
    )  # fmt: skip
    stated: list[ReferenceObject] = []
    form = ReferenceForm(lambda: stated.append(form.stated), lambda: None)
    qtbot.addWidget(form)
    form.show_state(states)
    form.show()
    size = form.form.inputs["size_mm"]
    assert isinstance(size, NumberField)
    form.activateWindow()
    size.setFocus()
    qtbot.waitUntil(size.hasFocus)
    for key in "4,87":
        QTest.keyClicks(size, key)
        form.show_state(replace(states, reconstructing=key == ","))
    assert not stated
    QTest.keyClick(size, Qt.Key.Key_Tab)
    assert [truth.size_mm for truth in stated] == [4.87]
    assert size.text() == "4.870 mm"
    assert {form.form.inputs[name].objectName() for name in LENGTHS} >= {size.objectName()}


@pytest.fixture
def field(qtbot):
    """Return a field of 5.000 mm on a window with a button and a shortcut, in a dialog."""
    dialog = Dialog(None, "dialog", "Dialog")
    made = NumberField(decimals=3, maximum=100.0, suffix=" mm", value=5.0)
    made.setSpecialValueText("not known")
    button = QPushButton("Other", objectName="other", focusPolicy=Qt.FocusPolicy.NoFocus)
    action = QAction(dialog, objectName="save", shortcut="Ctrl+S")
    dialog.addAction(action)
    dialog.fill(made, button)
    qtbot.addWidget(dialog)
    dialog.show()
    dialog.activateWindow()
    made.setFocus()
    qtbot.waitUntil(made.hasFocus)
    made.selectAll()
    yield made
    QToolTip.hideText()


def test_a_number_is_used_after_a_pause_and_its_text_stays(field, qtbot):
    used: list[float] = []
    field.valueChanged.connect(used.append)
    QTest.keyClicks(field, "4,8", delay=250)
    assert used == []
    qtbot.waitUntil(lambda: used == [4.8])
    assert field.text() == "4,8 mm"
    QTest.keyClicks(field, "7")
    assert field.text() == "4,87 mm"
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert used == [4.8, 4.87]
    assert field.text() == "4.870 mm"


def test_a_number_is_used_before_anything_else_is_done_with_it(field):
    seen: list[float] = []
    other = field.window().findChild(QPushButton, "other")
    other.clicked.connect(lambda: seen.append(field.value()))
    field.window().findChild(QAction, "save").triggered.connect(lambda: seen.append(field.value()))
    QTest.keyClicks(field, "4,87")
    QTest.mouseClick(other, Qt.MouseButton.LeftButton)
    field.selectAll()
    QTest.keyClicks(field, "13.6")
    QTest.keyClick(field, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    field.selectAll()
    QTest.keyClicks(field, "7")
    field.window().hide()
    assert [*seen, field.value()] == [4.87, 13.6, 7.0]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("1.234,5", "1234.5"),
        ("1,234,567", "1234567"),
        ("05", "'05' is not a number"),
        ("4 mm 5", "is not a number"),
        ("4.8765", "more than 3 decimals"),
        ("487", "from 0 to 100"),
    ],
)
def test_what_is_refused_stays_marked_and_keeps_a_dialog_open(field, qtbot, text, word):
    QTest.keyClicks(field, text)
    QTest.keyClick(field, Qt.Key.Key_Tab)
    assert field.cleanText() == text
    assert field.property("refused") is True
    assert word in field.refused and "5.000 mm" in field.refused
    qtbot.waitUntil(lambda: word in QToolTip.text())
    field.setValue(5.0)  # the same state is shown again
    field.window().accept()
    assert field.window().isVisible() and field.cleanText() == text
    field.selectAll()
    QTest.keyClicks(field, "6")
    field.window().accept()
    assert not field.window().isVisible() and not field.refused and field.value() == 6.0


def test_a_value_that_changes_elsewhere_is_shown_unless_one_is_typing(field):
    QTest.keyClicks(field, "4,87")
    field.setValue(9.0)
    assert field.text() == "4,87 mm"
    field.take(keep=True)
    assert (field.value(), field.text()) == (4.87, "4,87 mm")
    field.setValue(9.0)
    assert field.text() == "9.000 mm"
    field.setValue(0.0)
    assert field.text() == "not known"
    QTest.keyClicks(field, "3")  # typed over the words
    QTest.keyClick(field, Qt.Key.Key_Up)
    assert (field.value(), field.text()) == (4.0, "4.000 mm")
    field.selectAll()
    QTest.keyClicks(field, "50")
    field.take(keep=True)
    field.setRange(0.0, 10.0)
    assert field.text() == "10.000 mm"


def test_three_decimals_in_a_field_for_fewer_are_refused_with_both_readings(qtbot):
    layout, window = QVBoxLayout(), QWidget()
    qtbot.addWidget(window)
    window.setLayout(layout)
    for decimals in (0, 1):
        field = NumberField(decimals=decimals, maximum=100_000.0)
        layout.addWidget(field)
        for text in ("1,234", "1.234", "1,000"):
            field.selectAll()
            QTest.keyClicks(field, text)
            field.take()
            assert (text.replace(",", "."), text.replace(",", "").replace(".", "")) == tuple(
                field.refused.partition("could be ")[2].partition(". Write")[0].split(" or ")
            )
            assert field.value() == 0.0
