"""The button that shows the image source."""

import os

import pytest
from PySide6.QtWidgets import QFileDialog
from recorded import write_recording
from shiboken6 import isValid

from app.source_ui.source_button import SourceButton


@pytest.mark.function("Use a recording as the camera")
def test_a_recording_can_replace_the_camera(context, qtbot, tmp_path, monkeypatch):
    write_recording(tmp_path / "coin.gplrec")
    button = SourceButton(context=context)
    qtbot.addWidget(button)
    chosen = (str(tmp_path / "coin.gplrec"), "")
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: chosen)
    dialog = button.show_recordings()
    dialog.other_button.click()
    qtbot.waitUntil(lambda: not isValid(dialog))
    info = context.source.info
    assert (info.kind, info.name) == ("recording", "coin")
    assert "coin" in button.text()
    assert context.settings.folder("recording") == tmp_path
    assert context.settings.folder("images") != tmp_path
    source = info.open()
    source.open()
    assert source.frame(1.0).rgb.shape == (24, 32, 3)
    source.close()


def test_the_recordings_of_the_workspace_are_listed_with_their_first_image(context, qtbot):
    path = context.workspace.recording_path("S-1")
    write_recording(path)
    broken = context.workspace.recording_path("S-2")
    broken.write_bytes(b"no recording")
    os.utime(broken, (1e9, 1e9))
    button = SourceButton(context=context)
    qtbot.addWidget(button)
    dialog = button.show_recordings()
    assert [dialog.list.item(row).text()[:3] for row in range(2)] == ["S-1", "S-2"]
    assert "frames" in dialog.text.text()
    assert not dialog.image.pixmap().isNull()
    dialog.list.setCurrentRow(1)
    assert dialog.image.pixmap().isNull()
    dialog.list.setCurrentRow(0)
    dialog.play_button.click()
    qtbot.waitUntil(lambda: not isValid(dialog))
    assert context.source.info is not None and context.source.info.file == path
