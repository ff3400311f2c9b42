"""Files and folders that can be dropped onto the window."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QMimeData

from app.workspace.entries import ENDING
from app.workspace.sessions import DESCRIPTION, is_session
from gelpolight_core.recording.recording import ENDING as RECORDING_ENDING


@dataclass(frozen=True, slots=True)
class Dropped:
    """The session folders, calibration files and recordings among the dropped items."""

    sessions: tuple[Path, ...] = ()
    calibrations: tuple[Path, ...] = ()
    recordings: tuple[Path, ...] = ()

    def __bool__(self) -> bool:
        """Whether the program can open any of the items."""
        return bool(self.sessions or self.calibrations or self.recordings)


def sort_dropped(paths: tuple[Path, ...]) -> Dropped:
    """Find the items that the program opens. ``session.toml`` itself counts as its folder."""
    sessions = [p.parent if p.name == DESCRIPTION else p for p in paths]
    return Dropped(
        sessions=tuple(dict.fromkeys(p for p in sessions if is_session(p))),
        calibrations=_files(paths, ENDING),
        recordings=_files(paths, RECORDING_ENDING),
    )


def _files(paths: tuple[Path, ...], ending: str) -> tuple[Path, ...]:
    return tuple(path for path in paths if path.suffix.lower() == ending and path.is_file())


def dropped_paths(data: QMimeData) -> tuple[Path, ...]:
    """Return the local files and folders of a drag."""
    return tuple(Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile())
