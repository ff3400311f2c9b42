"""What the library knows of a session folder, without its pictures."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.reading import NAME_LIMIT, parse_toml, plain_text, read_file

DESCRIPTION = "session.toml"
PICTURES = (".png", ".tif", ".tiff")


@dataclass(frozen=True, slots=True)
class SessionEntry:
    """One session folder of the library.

    Attributes
    ----------
    folder : Path
        The folder.
    serial : str
        The sensor's; of a session that cannot be read, the name of the sensor's folder.
    pictures : int
        How many were captured.
    changed : datetime
        When something was last written into it.
    """

    folder: Path
    serial: str
    pictures: int
    changed: datetime


def read_session_entry(folder: Path) -> SessionEntry:
    """Return what is known of a session folder; a spoilt one is told of when it is opened.

    Raises
    ------
    OSError
        If the folder cannot be looked into.
    """
    stages = [path for path in folder.iterdir() if path.is_dir()]
    count = sum(
        path.suffix.lower() in PICTURES and not path.name.startswith(".")
        for stage in stages
        for path in stage.iterdir()
    )
    newest = max(path.stat().st_mtime for path in (folder / DESCRIPTION, *stages))
    return SessionEntry(folder, _serial(folder), count, file_time(newest))


def file_time(seconds: float) -> datetime:
    """Return a file's time; of one that no calendar has, as some archives say, the nearest."""
    try:
        return datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, ValueError, OSError):
        return (datetime.max if seconds > 0.0 else datetime.min).replace(tzinfo=UTC)


def _serial(folder: Path) -> str:
    try:
        content = parse_toml(read_file(folder / DESCRIPTION))
        return plain_text(content["sensor"]["serial"], NAME_LIMIT)
    except (InputError, FileNotFoundError, ValueError, KeyError, TypeError):
        return folder.parent.parent.name
