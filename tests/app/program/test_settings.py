"""The window's settings, with files from any origin."""

import os

import pytest
from PySide6.QtCore import QSettings

from app.program.preferences import WarningLimits, read_settings_section, settings_file
from app.program.settings import AppSettings


def test_settings_with_objects_are_set_aside_and_never_executed(tmp_path):
    class Harm:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(tmp_path / "harm"),)

    made = QSettings(str(tmp_path / "made.ini"), QSettings.Format.IniFormat)
    made.setValue("theme", Harm())
    made.sync()
    (tmp_path / "desktop.ini").write_bytes((tmp_path / "made.ini").read_bytes())
    settings = AppSettings(tmp_path / "desktop.ini")
    assert settings.preferences.theme == "system"
    assert not (tmp_path / "harm").exists()
    assert (tmp_path / "desktop.ini.refused").exists()


@pytest.mark.function("Judge by the tolerances of the preferences, in window and commands")
@pytest.mark.parametrize(
    "text",
    [
        "[limits]\nsize_percent=3\nheight_percent=1e-06\nage_days=30\n[window]\nage_days=7\n",
        "theme=dark\nsize_percent=2\n\n[limits]\nheight_percent=nan\nsize_percent=-1\n",
        "[other]\nsize_percent=2\n[limits]\n; a remark\nsize_percent=4.5",
        "",
    ],
)
def test_the_commands_read_the_tolerances_of_the_window(text):
    path = settings_file()
    assert read_settings_section(WarningLimits, "limits") == WarningLimits()
    path.parent.mkdir()
    path.write_text(text)
    assert read_settings_section(WarningLimits, "limits") == AppSettings(path).limits
    AppSettings(path).limits = WarningLimits(12.0, 3.25, 0.5)
    assert read_settings_section(WarningLimits, "limits") == WarningLimits(12.0, 3.25, 0.5)
