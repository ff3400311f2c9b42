"""File dialogs that begin in the folder that was chosen last, and files dropped on the window."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import QMimeData
from PySide6.QtWidgets import QFileDialog, QWidget

from gelpolight_core.output.recording.recording_format import ENDING as RECORDING_ENDING

from .calibration_entries import ENDING
from .session_entries import DESCRIPTION, is_session
from .settings import AppSettings

ENDINGS = re.compile(r"\*(\.[\w.]+)")
"""Endings of file names in patterns as in Qt."""


def sort_dropped(paths: tuple[Path, ...]) -> tuple[list[Path], list[Path], list[Path]]:
    """Return the session folders, calibrations and recordings among dropped items.

    ``session.toml`` itself counts as its folder.
    """
    folders = dict.fromkeys(p.parent if p.name == DESCRIPTION else p for p in paths)
    calibrations, recordings = (
        [path for path in paths if path.suffix.lower() == ending and path.is_file()]
        for ending in (ENDING, RECORDING_ENDING)
    )
    return list(filter(is_session, folders)), calibrations, recordings


def dropped_paths(data: QMimeData) -> tuple[Path, ...]:
    """Return the local files and folders of a drag."""
    return tuple(Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile())


def image_patterns() -> str:
    """Return the names of image files, as in Qt."""
    from gelpolight_core.image.image_file import SUFFIXES

    endings = " ".join(f"*{end}" for end in SUFFIXES)
    return f"Images ({endings})"


def ask_open(
    parent: QWidget, settings: AppSettings, kind: str, title: str, patterns: str
) -> Path | None:
    """Let the user choose a file. None: no file.

    Parameters
    ----------
    parent : QWidget
        The window.
    settings : AppSettings
        Keep the folder.
    kind : str
        Kind of file, such as ``recording``; each remembers a folder of its own.
    title : str
        Title of the dialog.
    patterns : str
        Names of the files, as in Qt.
    """
    name, _ = QFileDialog.getOpenFileName(parent, title, str(settings.folder(kind)), patterns)
    return _kept(settings, kind, name)


def ask_several(
    parent: QWidget, settings: AppSettings, kind: str, title: str, patterns: str
) -> tuple[Path, ...]:
    """Let the user choose files, as `ask_open` does one. Empty: none."""
    names, _ = QFileDialog.getOpenFileNames(parent, title, str(settings.folder(kind)), patterns)
    return tuple(path for path in (_kept(settings, kind, name) for name in names) if path)


def ask_save(
    parent: QWidget, settings: AppSettings, kind: str, title: str, name: str, patterns: str
) -> Path | None:
    """Let the user choose a file to write, `name` is proposed. See :func:`ask_open`.

    A name without one of the endings in `patterns` gets that of the chosen kind.
    """
    proposed = str(settings.folder(kind) / name)
    file, pattern = QFileDialog.getSaveFileName(parent, title, proposed, patterns)
    path = _kept(settings, kind, file)
    if path is None or path.name.lower().endswith(tuple(ENDINGS.findall(patterns.lower()))):
        return path
    path = path.with_name(path.name + ENDINGS.findall(pattern or patterns)[0])
    if path.exists():  # the dialog asks before it replaces a file
        return ask_save(parent, settings, kind, title, path.name, patterns)
    return path


def ask_folder(parent: QWidget, settings: AppSettings, kind: str, title: str) -> Path | None:
    """Let the user choose a folder. See :func:`ask_open`."""
    folder = QFileDialog.getExistingDirectory(parent, title, str(settings.folder(kind)))
    if folder:
        settings.keep_folder(kind, Path(folder))
    return Path(folder) if folder else None


def _kept(settings: AppSettings, kind: str, name: str) -> Path | None:
    if not name:
        return None
    settings.keep_folder(kind, Path(name).parent)
    return Path(name)
