"""Dialogs of the Inspect page leave nothing behind after many uses."""

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QSize, Qt
from PySide6.QtWidgets import QApplication, QDialog, QLineEdit, QWidget

from app.inspect.export import ExportChoice, export_dialog
from app.views.surface.scene_export import image_dialog

DIALOGS: dict[str, Callable[[QWidget], QDialog]] = {
    "export": lambda host: export_dialog(Path("depth"), print, count=3, at=1, parent=host),
    "image": lambda host: image_dialog(QSize(400, 300), ("surface", "views"), print, host),
}


@pytest.mark.parametrize("name", DIALOGS)
def test_nothing_of_a_dialog_is_left_when_it_is_closed(name, qtbot):
    host = QWidget()
    qtbot.addWidget(host)
    host.show()
    before = len(QApplication.allWidgets())
    for accepted in (True, False, True, False):
        dialog = DIALOGS[name](host)
        dialog.open()
        if accepted:
            dialog.accept()
        else:
            qtbot.keyClick(dialog, Qt.Key.Key_Escape)
        del dialog
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert len(QApplication.allWidgets()) == before
    assert host.findChildren(QDialog) == []


@pytest.mark.parametrize(
    ("typed", "expected"), [("run 3", "lab/run 3"), ("/data/x", "/data/x"), ("~", "~")]
)
def test_a_name_without_path_is_a_folder_next_to_the_proposed_one(typed, expected, tmp_path, qtbot):
    host = QWidget()
    qtbot.addWidget(host)
    chosen: list[ExportChoice] = []
    dialog = export_dialog(tmp_path / "lab" / "proposed", chosen.append, parent=host)
    dialog.open()
    line = dialog.findChild(QLineEdit, "inspect.export.folder")
    line.setText(typed)
    qtbot.keyClick(line, Qt.Key.Key_Return)
    assert Path(chosen[0].folder) == tmp_path / Path(expected).expanduser()
