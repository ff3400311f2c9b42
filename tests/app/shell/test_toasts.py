"""Messages: shown, stacked, counted, closed; problems stay until they are closed."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.shell.context import AppContext
from app.shell.toasts import MOST, Toasts


@pytest.fixture
def host(context: AppContext, qtbot: QtBot) -> Iterator[QWidget]:
    widget = QWidget()
    qtbot.addWidget(widget)
    widget.resize(800, 600)
    context.toasts.attach(widget, lambda: None)
    widget.show()
    yield widget


def texts(toasts: Toasts) -> list[str]:
    return [toast.text for toast in toasts.shown()]


def test_messages_stack_without_covering_one_another(context: AppContext, host: QWidget) -> None:
    for text in ("first", "second, which is so long that it needs several lines. " * 4, "third"):
        context.toasts.show(text)
    areas = [toast.geometry() for toast in context.toasts.shown()]
    for i, one in enumerate(areas):
        assert host.rect().contains(one)
        assert not any(one.intersects(other) for other in areas[i + 1 :])


def test_the_same_message_is_counted_instead_of_filling_the_window(
    context: AppContext, host: QWidget
) -> None:
    for _ in range(50):
        context.toasts.show("The camera is gone.", "fail")
    assert len(context.toasts.shown()) == 1
    assert context.toasts.shown()[0].times == 50


def test_only_the_newest_messages_are_shown(context: AppContext, host: QWidget) -> None:
    for number in range(3 * MOST):
        context.toasts.show(f"message {number}", "fail")
    assert texts(context.toasts) == [f"message {n}" for n in range(2 * MOST, 3 * MOST)]


def test_a_note_goes_by_itself_and_a_problem_stays(context: AppContext, host: QWidget) -> None:
    context.toasts.show("saved")
    context.toasts.show("not saved", "fail")
    note, problem = context.toasts.shown()
    assert note.findChild(QTimer).isActive()
    assert not problem.findChild(QTimer).isActive()
    note.findChild(QTimer).timeout.emit()
    assert texts(context.toasts) == ["not saved"]


def test_its_button_acts_once_and_closes_it(
    context: AppContext, host: QWidget, qtbot: QtBot
) -> None:
    undone = []
    context.toasts.show("removed", actions=(("Undo", lambda: undone.append(1)),))
    button = context.toasts.shown()[0].findChild(QPushButton)
    assert button.accessibleName() == "Undo"
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert undone == [1]
    assert not context.toasts.shown()


def test_every_message_is_in_the_log(context: AppContext, host: QWidget) -> None:
    context.toasts.show("the disk is full", "fail")
    assert any("the disk is full" in r.text for r in context.log.recent.since(0))


def test_messages_stay_in_the_window_when_it_shrinks(
    context: AppContext, host: QWidget, qtbot: QtBot
) -> None:
    context.toasts.show("a message")
    host.resize(300, 200)
    qtbot.waitUntil(lambda: host.rect().contains(context.toasts.shown()[0].geometry()))
