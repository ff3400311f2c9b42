"""The curve editor by mouse and keys."""

import itertools
from functools import partial

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QUndoStack
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton
from test_lut_model import fitted, scatter

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_editor import LutEditor
from app.calibrate.reflectance.lut_model import CurveSet
from app.widgets.actions import UndoStep
from gelpolight_core.calibration.edit_effect import CurveEditEffect

MOVE_MS = 12
"""The plot processes at most 100 mouse moves per second."""


def effect(nodes: dict[int, tuple[np.ndarray, np.ndarray]], press: str) -> CurveEditEffect:
    """Return an artificial effect whose depth is the middle value of the red curve."""
    position = np.linspace(-3.0, 3.0, 61)
    ball = np.where(np.abs(position) < 1.5, 1.0 - 0.1 * position**2, np.nan)
    depth = np.full(61, float(np.interp(0.5, *nodes[0])))
    return CurveEditEffect(position, depth, ball, float(depth[0]), 0.0)


@pytest.fixture
def editor(qtbot):
    """Return a visible editor."""
    stack = QUndoStack()

    def history(text: str, after: CurveSet) -> None:
        act, revert = partial(widget.show_curves, after), partial(widget.show_curves, widget.curves)
        stack.push(UndoStep(text, act, revert))

    curves = model.fitted_curves(fitted())
    widget = LutEditor(fitted(), curves, scatter(), effect=effect, history=history)
    widget.undo_stack = stack
    qtbot.addWidget(widget)
    widget.resize(1100, 700)
    with qtbot.waitExposed(widget):
        widget.show()
    widget.activateWindow()
    widget.plot.setFocus()
    qtbot.wait(50)
    yield widget
    assert widget.stop()
    stack.clear()  # its commands hold the editor


def pixel(editor: LutEditor, cosine: float, value: float) -> QPoint:
    """Return the position of a point of the curve in the plot's viewport."""
    position = editor.plot.getViewBox().mapViewToScene(QPointF(cosine, value))
    return editor.plot.mapFromScene(position)


def send(editor: LutEditor, kind: QEvent.Type, position: QPoint, *, held: bool) -> None:
    """Send a mouse event; pytest-qt's own moves hold no button down."""
    view, left, none = editor.plot.viewport(), Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
    cause = none if kind == QEvent.Type.MouseMove else left
    at, everywhere = QPointF(position), QPointF(view.mapToGlobal(position))
    buttons, keys = left if held else none, Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(view, QMouseEvent(kind, at, everywhere, cause, buttons, keys))


def drag(editor: LutEditor, *points: tuple[float, float]) -> None:
    """Drag the left button along points of the plot."""
    positions = [pixel(editor, *point) for point in points]
    send(editor, QEvent.Type.MouseMove, positions[0], held=False)
    send(editor, QEvent.Type.MouseButtonPress, positions[0], held=True)
    for a, b in itertools.pairwise(positions):
        for share in np.linspace(0.1, 1.0, 10):
            QTest.qWait(MOVE_MS)
            send(editor, QEvent.Type.MouseMove, a + (b - a) * float(share), held=True)
    send(editor, QEvent.Type.MouseButtonRelease, positions[-1], held=False)


@pytest.mark.function("Edit a reflectance curve by its nodes")
def test_a_node_follows_the_mouse_and_one_undo_restores_it(editor):
    before = editor.curves
    cosine, value = editor.curve.points[3]
    drag(editor, (cosine, value), (cosine, value - 0.03))
    assert editor.curve.values[3] == pytest.approx(value - 0.03, abs=0.01)
    assert editor.chosen == 3
    after = editor.curves
    assert editor.undo_stack.count() == 1  # once, after the drag
    editor.undo_stack.undo()
    assert editor.curves == before
    editor.undo_stack.redo()
    assert editor.curves == after


@pytest.mark.function("Type the position of a node of a reflectance curve")
def test_a_typed_value_moves_the_node_or_is_refused_in_words(editor):
    before = editor.curve
    value = 0.5 * (before.values[3] + before.values[4])
    editor.nodes.item(3, 1).setText(f"{value:.4f}".replace(".", ","))
    assert editor.curve.values[3] == pytest.approx(value, abs=1e-4)
    moved = editor.curve
    for refused in ("9", "high", "1,234.5"):
        editor.nodes.item(3, 1).setText(refused)
        assert editor.curve == moved
        assert editor.nodes.item(3, 1).text() == refused
        assert refused in editor.nodes.item(3, 1).toolTip()
    editor.nodes.item(3, 1).setText(f"{value:.4f}")
    assert not editor.nodes.item(3, 1).toolTip()


def test_reset_returns_to_the_fit_and_is_undone(editor):
    editor._on_moved(3, *editor.curve.points[4], True)
    moved = editor.curve
    editor.findChild(QPushButton, "lut.reset").click()
    assert editor.curves == editor.fitted
    editor.undo_stack.undo()
    assert editor.curve == moved


def test_an_editor_that_is_shown_after_it_was_stopped_starts_no_thread(editor):
    editor.hide()
    assert editor.stop()
    editor.show()
    assert not editor.preview.jobs.busy
