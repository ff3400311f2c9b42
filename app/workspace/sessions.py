"""Library entry of a session folder. The images are not read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from app.workspace.entries import Entry
from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import NAME_LIMIT, parse_toml, plain_text, read_file

DESCRIPTION = "session.toml"
# Key of the stage of each image folder, in the order of the captures.
STAGES = {
    "checkerboard": "lens",
    "top_pose": "top_pose",
    "mirror": "lights",
    "whiteboard": "radiance",
    "background": "background",
    "balls": "balls",
}
# Of a closed sensor, and the table in the description that makes it one.
IN_PLACE = "in_place"
CLOSED_STAGES = ("background", "balls")
IMAGES = (".png", ".tif", ".tiff")


@dataclass(frozen=True, slots=True)
class SessionEntry:
    """One session folder of the library.

    Attributes
    ----------
    folder : Path
        The folder.
    serial : str
        The sensor's serial. If the session cannot be read, the name of the sensor's folder.
    images : int
        Number of images.
    changed : datetime
        Time of the last change.
    newest : Path or None
        The image that was added last.
    stages : tuple of str
        Keys of the stages that have images.
    closed : bool
        Whether the session is of a closed sensor, which has fewer stages.
    """

    folder: Path
    serial: str
    images: int
    changed: datetime
    newest: Path | None = None
    stages: tuple[str, ...] = ()
    closed: bool = False

    @property
    def next_stage(self) -> str:
        """Key of the first stage without images. Empty if every stage has some."""
        needed = CLOSED_STAGES if self.closed else STAGES.values()
        return next((key for key in needed if key not in self.stages), "")


def read_session_entry(folder: Path) -> SessionEntry:
    """Return the library entry of a session folder. A damaged one is reported when it is opened.

    Raises
    ------
    OSError
        If the folder cannot be read.
    """
    folders = [path for path in folder.iterdir() if path.is_dir()]
    images = [
        path
        for stage in folders
        for path in stage.iterdir()
        if path.suffix.lower() in IMAGES and not path.name.startswith(".")
    ]
    serial, closed = _description(folder)
    changed = max(path.stat().st_mtime for path in (folder / DESCRIPTION, *folders))
    return SessionEntry(
        folder,
        serial,
        len(images),
        file_time(changed),
        newest=max(images, key=lambda path: path.stat().st_mtime, default=None),
        stages=tuple(
            dict.fromkeys(STAGES[p.parent.name] for p in images if p.parent.name in STAGES)
        ),
        closed=closed,
    )


def unfinished(
    sessions: Iterable[SessionEntry], entries: Iterable[Entry]
) -> tuple[SessionEntry, ...]:
    """Return the sessions from which no calibration was saved."""
    saved = {(e.serial, e.summary.session) for e in entries if e.summary is not None}
    return tuple(s for s in sessions if (s.serial, s.folder.name) not in saved)


def file_time(seconds: float) -> datetime:
    """Return a file's time. If it is out of range, as in some archives, the nearest valid time."""
    try:
        return datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, ValueError, OSError):
        return (datetime.max if seconds > 0.0 else datetime.min).replace(tzinfo=UTC)


def _description(folder: Path) -> tuple[str, bool]:
    """Return the serial of the sensor, and whether it is closed."""
    try:
        content = parse_toml(read_file(folder / DESCRIPTION))
        return plain_text(content["sensor"]["serial"], NAME_LIMIT), IN_PLACE in content
    except (InputError, FileNotFoundError, ValueError, KeyError, TypeError):
        return folder.parent.parent.name, False
