"""The button that says where pictures come from."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QFileDialog
from pytest import MonkeyPatch
from pytestqt.qtbot import QtBot
from recorded import write_recording

from app.shell.context import AppContext
from app.widgets.source_button import SourceButton


def test_a_recording_can_play_the_camera(
    context: AppContext, qtbot: QtBot, tmp_path: Path, monkeypatch: MonkeyPatch
) -> None:
    write_recording(tmp_path / "coin.gplrec")
    button = SourceButton(context=context, page="calibrate", none="No camera")
    qtbot.addWidget(button)
    chosen = (str(tmp_path / "coin.gplrec"), "")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: chosen)
    button.findChild(QAction, "calibrate.source.recording").trigger()
    info = context.source.info
    assert info is not None
    assert (info.kind, info.name) == ("recording", "coin")
    assert "coin" in button.text()
    assert context.settings.last_folder == tmp_path
    source = info.open()
    source.open()
    assert source.size == (32, 24)
    source.close()
