"""Library entry of a session folder. The images are not read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.safe_reading import NAME_LIMIT, plain_text

from .calibration_entries import CalibrationEntry

if TYPE_CHECKING:
    from gelpolight_core.session.inventory import SessionInventory
    from gelpolight_core.session.session import Session

DESCRIPTION = "session.toml"


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
    next_stage : str
        Key of the first stage without images. Empty if every stage has some.
    """

    folder: Path
    serial: str
    images: int
    changed: datetime
    newest: Path | None = None
    next_stage: str = ""


def is_session(folder: Path) -> bool:
    """Whether a folder is a session folder."""
    return (folder / DESCRIPTION).is_file()


def read_session_entry(folder: Path) -> SessionEntry:
    """Return the library entry of a session folder. A damaged one is reported when it is opened.

    Raises
    ------
    OSError
        If the folder cannot be read.
    """
    from gelpolight_core.calibration.recipes import recipe_of
    from gelpolight_core.session.inventory import SessionInventory

    inventory = SessionInventory(folder)
    folders = [path for path in folder.iterdir() if path.is_dir()]
    images = [image for path in folders for image in inventory.stage(path.name).images]
    newest = max(images, key=lambda image: image.changed_ns, default=None)
    session = _described(inventory)
    recipe = recipe_of(session)
    missing = recipe.missing(session)
    return SessionEntry(
        folder,
        session.serial,
        len(images),
        file_time(max(path.stat().st_mtime for path in (folder / DESCRIPTION, *folders))),
        newest=None if newest is None else newest.path,
        next_stage=next((stage.key for stage in recipe.stages if stage.folder in missing), ""),
    )


def unfinished_sessions(
    sessions: Iterable[SessionEntry], entries: Iterable[CalibrationEntry]
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


def _described(inventory: SessionInventory) -> Session:
    """Return serial and kind of the sensor, also if the description lacks the rest."""
    from gelpolight_core.session.inventory import IN_PLACE
    from gelpolight_core.session.session import ClosedSensorSettings, SensorData, Session

    folder = inventory.folder
    in_place = None
    try:
        content = inventory.description
        serial = plain_text(content["sensor"]["serial"], NAME_LIMIT)
        if inventory.closed:
            in_place = ClosedSensorSettings(content[IN_PLACE].get("mm_per_px"))
    except (InputError, ValueError, KeyError, TypeError, AttributeError):
        serial, in_place = folder.parent.parent.name, None
    return Session(folder, SensorData(serial), in_place=in_place, inventory=inventory)
