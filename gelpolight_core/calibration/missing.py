"""Sessions that are to be calibrated, with everything that they lack in one message."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from gelpolight_core.calibration.in_place import IN_PLACE
from gelpolight_core.calibration.open_sensor import RADIANCE
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.file import names_of
from gelpolight_core.session.inventory import SessionInventory
from gelpolight_core.session.session import SensorData, Session, parse_session

OPEN_FOLDERS = frozenset(FULL.own_folders).difference(IN_PLACE.own_folders)
"""Folders of images that need the sensor open."""
TABLES = ("checkerboard", "balls")
"""Tables that session.toml of an open sensor must have, beside ``[sensor]``."""


def session_to_calibrate(folder: Path) -> Session:
    """Read a session folder, as :func:`~gelpolight_core.session.session.read_session`.

    Raises
    ------
    InputError
        As there. Where tables and images of an open sensor are missing, one message lists
        everything that is missing and offers the closed route.
    """
    inventory = SessionInventory(folder)
    absent = [name for name in TABLES if name not in inventory.description]
    if absent and not inventory.closed:
        session = Session(folder, SensorData(""), inventory=inventory)
        refuse_missing(session, FULL.missing(session), absent)
    return parse_session(inventory)


def needs_only_open_sensor(session: Session) -> bool:
    """Return whether a session lacks images of an open sensor, and nothing else."""
    missing = FULL.missing(session)
    return bool(missing) and OPEN_FOLDERS.issuperset(missing)


def refuse_missing(
    session: Session, missing: Collection[str], absent_tables: Collection[str] = ()
) -> None:
    """Refuse a session without the images in some folders.

    Raises
    ------
    InputError
        If there are any such folders; it also lists the tables that are absent.
    """
    if not missing:
        return
    found = f"the session has no images of: {', '.join(missing)}"
    if others := [path for name in missing for path in session.inventory.stage(name).others]:
        found += f" ({len(others)} files there are not images: {names_of(others)})"
    if absent_tables:
        found += "; session.toml lacks the tables {tables}".format(
            tables=", ".join(f"[{name}]" for name in absent_tables)
        )
    advice: str = Remedy.CAPTURE_STAGE
    if opened := [name for name in missing if name in OPEN_FOLDERS]:
        found += f"; the sensor must be open for: {', '.join(opened)}"
        advice = (
            "Capture these images; or calibrate in place, from background and balls alone: replace "
            "[checkerboard] and [top_pose] in session.toml with [in_place] mm_per_px = ..."
        )
    if set(missing) == {RADIANCE.folder}:
        advice = "Capture them, or state in [membrane] of session.toml that it is curved"
    raise InputError(found, session.folder, advice)
