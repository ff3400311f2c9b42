"""Files and folders that can be dropped onto the window."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QMimeData

from gelpolight_core.output.recording.recording_format import ENDING as RECORDING_ENDING

from .calibration_entries import ENDING
from .session_entries import DESCRIPTION, is_session


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
