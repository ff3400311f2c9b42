"""Searching for objects leaves nothing behind."""

from __future__ import annotations

import gc

from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QApplication, QFileDialog, QLineEdit, QMainWindow, QScrollBar, QWidget

from app.widgets.qt_tree import below


def file_dialog(window: QWidget) -> QFileDialog:
    """Return a dialog with many widgets that Python did not make."""
    dialog = QFileDialog(window)
    dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
    dialog.show()
    return dialog


def scroll_bars() -> int:
    """Return how many scroll bars Python knows, including deleted ones."""
    gc.collect()
    return sum(isinstance(thing, QScrollBar) for thing in gc.get_objects())


def test_it_finds_what_qt_finds(qtbot) -> None:
    window = QMainWindow()
    qtbot.addWidget(window)
    file_dialog(window)
    for kind in (QObject, QScrollBar):
        found = list(below(window, kind))
        assert len(found) > 2
        assert set(map(id, found)) == set(map(id, window.findChildren(kind)))
    (line,) = below(window, QLineEdit, "fileNameEdit")
    assert line is window.findChild(QLineEdit, "fileNameEdit")


def test_found_objects_are_deleted_with_their_dialog(qtbot) -> None:
    window = QMainWindow()
    qtbot.addWidget(window)
    before = scroll_bars()
    for _ in range(3):
        dialog = file_dialog(window)
        assert sum(1 for _bar in below(window, QScrollBar)) > 2
        dialog.close()
        dialog.deleteLater()
        del dialog
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert scroll_bars() <= before
