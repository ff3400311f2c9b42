"""The presses on the gel since each calibration, in the workspace."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gelpolight_core.io.atomic import make_folder, write_json
from gelpolight_core.io.reading import brief, plain_text, read_own

FILE = "gel-care.json"
FORMAT = "gelpolight-gel-care"
VERSION = 2


def presses_text(presses: int) -> str:
    """Return the number of presses as text."""
    return f"Presses since the calibration: {presses}"


def read_presses(folder: Path) -> dict[str, int]:
    """Return the number of presses by the identity of the calibration.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, or has a newer version.
    """
    found = read_own(
        folder / FILE,
        (FORMAT, VERSION),
        lambda content: {
            plain_text(identity): _presses(row["presses"])
            for identity, row in content["calibrations"].items()
        },
        found="The list of presses cannot be read ({error})",
    )
    return found or {}


def write_presses(presses: Mapping[str, int], folder: Path) -> None:
    """Write the numbers of presses, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    rows = {identity: {"presses": number} for identity, number in presses.items()}
    content = {"format": FORMAT, "version": VERSION, "calibrations": rows}
    make_folder(folder)
    write_json(folder / FILE, content)


def _presses(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= 10**9:
        raise ValueError(f"{brief(value)} is not a number of presses")
    return value
