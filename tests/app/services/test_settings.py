"""The window's settings, with files from any origin."""

from __future__ import annotations

import os
from pathlib import Path

from PySide6.QtCore import QSettings

from app.services.settings import Settings


def test_settings_with_objects_are_set_aside_and_never_executed(
    tmp_path: Path,
) -> None:
    class Harm:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(tmp_path / "harm"),)

    made = QSettings(str(tmp_path / "made.ini"), QSettings.Format.IniFormat)
    made.setValue("theme", Harm())
    made.sync()
    (tmp_path / "desktop.ini").write_bytes((tmp_path / "made.ini").read_bytes())
    settings = Settings(tmp_path / "desktop.ini")
    assert settings.preferences.theme == "system"
    assert not (tmp_path / "harm").exists()
    assert (tmp_path / "desktop.ini.refused").exists()
