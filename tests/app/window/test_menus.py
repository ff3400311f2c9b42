"""Searching for the children of a window leaves nothing behind."""

import gc

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QFileDialog, QMainWindow, QScrollBar, QWidget

from app.window.menus import find_children


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


def test_found_objects_are_deleted_with_their_dialog(qtbot):
    window = QMainWindow()
    qtbot.addWidget(window)
    before = scroll_bars()
    for _ in range(3):
        dialog = file_dialog(window)
        assert sum(1 for _bar in find_children(window, QScrollBar)) > 2
        dialog.close()
        dialog.deleteLater()
        del dialog
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert scroll_bars() <= before
