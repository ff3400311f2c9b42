"""The curve editor by mouse and keys."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QUndoStack
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot
from test_lut_model import scatter, start

from app.calibrate.model import Correction
from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_editor import NUDGE, LutEditor
from app.calibrate.reflectance.lut_effect import Effect
from app.calibrate.reflectance.lut_model import CurveEdit

MOVE_MS = 12
"""The plot processes at most 100 mouse moves per second."""


def effect(edit: CurveEdit, press: str) -> Effect:
    """Return an artificial effect whose depth is the middle value of the red curve."""
    position = np.linspace(-3.0, 3.0, 61)
    ball = np.where(np.abs(position) < 1.5, 1.0 - 0.1 * position**2, np.nan)
    depth = np.full(61, float(edit[0].curve.at(0.5)))
    return Effect(press, position, depth, ball, float(depth[0]), 0.0)


@pytest.fixture
def editor(qtbot: QtBot) -> Iterator[LutEditor]:
    """Return a visible editor with few nodes."""
    stack = QUndoStack()

    def history(text: str, before: CurveEdit, after: CurveEdit) -> None:
        show = partial(partial, widget.show_state)
        swap = Correction(text, show(after), show(before), done=list, refused=pytest.fail)
        stack.push(swap)

    widget = LutEditor(model.thin_nodes(start(), 0), scatter(), effect=effect, history=history)
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
    position = editor.plot.box.mapViewToScene(QPointF(cosine, value))
    return editor.plot.mapFromScene(position)


def send(editor: LutEditor, kind: QEvent.Type, position: QPoint, *, held: bool) -> None:
    """Send a mouse event; pytest-qt's own moves hold no button down."""
    view, left, none = editor.plot.viewport(), Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
    cause = none if kind == QEvent.Type.MouseMove else left
    at = QPointF(position)
    event = QMouseEvent(
        kind,
        at,
        QPointF(view.mapToGlobal(position)),
        cause,
        left if held else none,
        Qt.KeyboardModifier.NoModifier,
    )
    QApplication.sendEvent(view, event)


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


def click(editor: LutEditor, cosine: float, value: float, *, double: bool = False) -> None:
    """Click or double-click a point of the plot."""
    position = pixel(editor, cosine, value)
    send(editor, QEvent.Type.MouseMove, position, held=False)
    for kind in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)[: 1 + double]:
        send(editor, kind, position, held=True)
        send(editor, QEvent.Type.MouseButtonRelease, position, held=False)


def node(editor: LutEditor, index: int) -> tuple[float, float]:
    """Return a node of the shown channel."""
    curve = editor.state[editor.channel].curve
    return curve.cosines[index], curve.values[index]


def test_a_node_follows_the_mouse_and_one_undo_restores_it(editor: LutEditor) -> None:
    before = editor.state
    cosine, value = node(editor, 3)
    states: list[CurveEdit] = []
    editor.edited.connect(states.append)
    drag(editor, (cosine, value), (cosine, value - 0.03))
    assert node(editor, 3)[1] == pytest.approx(value - 0.03, abs=0.01)
    assert editor.chosen == 3
    assert states == [editor.state]  # once, after the drag
    editor.undo_stack.undo()
    assert editor.state == before
    editor.undo_stack.redo()
    assert editor.state == states[0]


def test_a_click_selects_a_node_and_del_removes_it(qtbot: QtBot, editor: LutEditor) -> None:
    count = len(editor.state[0].curve.cosines)
    click(editor, *node(editor, 2))
    assert editor.chosen == 2
    gone = node(editor, 2)
    qtbot.keyClick(editor.plot, Qt.Key.Key_Delete)
    assert len(editor.state[0].curve.cosines) == count - 1
    assert gone[0] not in editor.state[0].curve.cosines


@pytest.mark.parametrize(
    ("key", "modifier", "across", "up"),
    [
        (Qt.Key.Key_Left, Qt.KeyboardModifier.NoModifier, -1, 0),
        (Qt.Key.Key_Right, Qt.KeyboardModifier.NoModifier, 1, 0),
        (Qt.Key.Key_Up, Qt.KeyboardModifier.NoModifier, 0, 1),
        (Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier, 0, -10),
    ],
)
def test_arrow_keys_move_the_selected_node(
    qtbot: QtBot,
    editor: LutEditor,
    key: Qt.Key,
    modifier: Qt.KeyboardModifier,
    across: int,
    up: int,
) -> None:
    editor.choose_node(3)
    cosine, value = node(editor, 3)
    qtbot.keyClick(editor.plot, key, modifier)
    top = editor.state[0].curve.values[-1]
    expected = (cosine + NUDGE * across, value + NUDGE * up * top)
    assert node(editor, 3) == pytest.approx(expected)


def test_a_double_click_on_the_curve_adds_a_node_there(editor: LutEditor) -> None:
    curve = editor.state[0].curve
    cosine = 0.5 * (curve.cosines[3] + curve.cosines[4])
    click(editor, cosine, float(curve.at(cosine)), double=True)
    assert len(editor.state[0].curve.cosines) == len(curve.cosines) + 1
    assert node(editor, 4)[0] == pytest.approx(cosine, abs=0.01)


def test_the_lasso_excludes_points_and_reports_how_many(editor: LutEditor) -> None:
    editor.findChild(type(editor._actions["lasso"]), "lut.lasso").trigger()
    outline = [(0.48, 0.62), (0.62, 0.75), (0.62, 0.95), (0.48, 0.8)]
    drag(editor, *outline)
    assert float(editor.state[0].curve.at(0.55)) == pytest.approx(0.05 + 0.9 * 0.55**1.3, abs=0.02)
    assert "points are excluded" in editor._notice.text()
    editor.undo_stack.undo()
    assert [channel.left_out for channel in editor.state] == [(), (), ()]


@pytest.mark.parametrize("name", ["add", "thin", "snap", "smooth", "reset", "compare", "view"])
def test_every_tool_has_a_button_and_none_fails(editor: LutEditor, name: str) -> None:
    editor._on_node_moved(3, *node(editor, 3), True)
    action = editor._actions[name]
    button = editor.findChild(object, f"lut.{name}.button")
    assert button is not None and button.accessibleName()
    action.trigger()
    assert editor._notice.text() == ""


def test_an_impossible_edit_is_explained_in_one_sentence(editor: LutEditor) -> None:
    editor._add_at(editor.state[0].curve.cosines[2])
    assert "no room" in editor._notice.text()
    assert not editor.undo_stack.canUndo()
