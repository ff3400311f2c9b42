"""Messages: shown, stacked, counted, closed. Errors stay until they are closed."""

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QPushButton, QWidget

from app.program.log import NAME
from app.program.toasts import Toasts


@pytest.fixture
def host(context, qtbot):
    widget = QWidget()
    qtbot.addWidget(widget)
    widget.resize(800, 600)
    context.toasts.attach(widget, lambda: None)
    widget.show()
    yield widget


def texts(toasts: Toasts) -> list[str]:
    return [toast.text for toast in toasts.shown()]


def test_messages_stack_without_covering_one_another(context, host):
    for text in ("first", "second, which is so long that it needs several lines. " * 4, "third"):
        context.toasts.show(text)
    areas = [toast.geometry() for toast in context.toasts.shown()]
    for i, one in enumerate(areas):
        assert host.rect().contains(one)
        assert not any(one.intersects(other) for other in areas[i + 1 :])


def test_they_are_where_no_page_has_a_main_button(context, host):
    context.toasts.show("not saved", "fail")
    (toast,) = context.toasts.shown()
    assert toast.geometry().right() < host.rect().center().x() + 50
    assert toast.geometry().bottom() > host.rect().center().y()


def test_a_note_disappears_and_an_error_stays(context, host):
    context.toasts.show("saved")
    context.toasts.show("not saved", "fail")
    note, problem = context.toasts.shown()
    assert note.findChild(QTimer).isActive()
    assert not problem.findChild(QTimer).isActive()
    note.findChild(QTimer).timeout.emit()
    assert texts(context.toasts) == ["not saved"]


def test_its_button_acts_once_and_closes_it(context, host, qtbot):
    undone = []
    context.toasts.show("removed", actions=(("Undo", lambda: undone.append(1)),))
    button = context.toasts.shown()[0].findChild(QPushButton)
    assert button.accessibleName() == "Undo"
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert undone == [1]
    assert not context.toasts.shown()


def test_a_repeated_message_is_counted_and_each_is_in_the_log(context, host):
    for _ in range(3):
        context.toasts.show("not saved", "fail")
    assert texts(context.toasts) == ["not saved"]
    assert context.toasts.shown()[0].times == 3
    context.toasts.clear()
    assert not context.toasts.shown()
    assert (context.log.folder / NAME).read_text("utf-8").count("not saved") == 3
