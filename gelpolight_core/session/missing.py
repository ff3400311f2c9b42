"""The missing parts of a session for the calibration of an open sensor, in one message."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.session.images import SUFFIXES
from gelpolight_core.translation import tr

OPEN_STAGES = ("checkerboard", "top_pose", "mirror", "whiteboard")
"""Stages whose images need the sensor open: lens, top surface, LEDs and light intensity."""
CLOSED_STAGES = ("background", "balls")
STAGES = (*OPEN_STAGES, *CLOSED_STAGES)
TABLES = ("checkerboard", "balls")
"""Tables that session.toml must have, beside ``[sensor]``."""


def refuse_undescribed(content: Mapping[str, Any], folder: Path) -> None:
    """Refuse a description without the tables of an open sensor, with all that is missing.

    Parameters
    ----------
    content : mapping
        Of session.toml.
    folder : Path
        The session.

    Raises
    ------
    InputError
        If a table is missing. A complete set of images without its description is left to the
        parser, which names the key.
    """
    absent = [name for name in TABLES if name not in content]
    missing = missing_stages(folder)
    if absent and missing:
        raise _refusal(folder, missing, absent)


def refuse_missing_stages(folder: Path, missing: Collection[str]) -> None:
    """Refuse a session that lacks images of any stage, with all stages that are missing.

    Raises
    ------
    InputError
        If there are any.
    """
    if missing:
        raise _refusal(folder, missing, ())


def missing_stages(folder: Path) -> tuple[str, ...]:
    """Return the stages of an open sensor's calibration without an image."""

    def has_images(stage: str) -> bool:
        return any(p.suffix.lower() in SUFFIXES for p in (folder / stage).glob("[!.]*"))

    return tuple(stage for stage in STAGES if not has_images(stage))


def _refusal(folder: Path, missing: Collection[str], tables: Collection[str]) -> InputError:
    found = tr("the session has no images of: {stages}").format(stages=", ".join(missing))
    opened = [stage for stage in missing if stage in OPEN_STAGES]
    if tables:
        found += tr("; session.toml lacks the tables {tables}").format(
            tables=", ".join(f"[{name}]" for name in tables)
        )
    if not opened:
        return InputError(found, where=folder, advice=Remedy.CAPTURE_STAGE)
    found += tr("; the sensor must be open for: {stages}").format(stages=", ".join(opened))
    return InputError(
        found,
        where=folder,
        advice=tr(
            "Capture these images; or calibrate in place, from background and balls alone: replace "
            "[checkerboard] and [top_pose] in session.toml with [in_place] mm_per_px = ..."
        ),
    )
