"""What the library knows of a session folder, without its pictures."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

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
    return SessionEntry(folder, _serial(folder), count, datetime.fromtimestamp(newest, UTC))


def _serial(folder: Path) -> str:
    try:
        content = tomllib.loads((folder / DESCRIPTION).read_text("utf-8"))
        return str(content["sensor"]["serial"])
    except (ValueError, KeyError, TypeError):
        return folder.parent.parent.name
