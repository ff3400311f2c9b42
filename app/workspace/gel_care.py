"""The presses on the gel since each calibration, in the workspace."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.workspace.files import write_bytes
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.reading import NEWEST, brief, parse_json, plain_text, read_file
from gelpolight_core.translation import tr

FILE = "gel-care.json"
FORMAT = "gelpolight-gel-care"
VERSION = 2
SIZE_LIMIT = 4_000_000
MOST_PRESSES = 10**9


def presses_text(presses: int) -> str:
    """Return the number of presses as text."""
    return tr("Presses since the calibration: {n}").format(n=presses)


def read_presses(folder: Path) -> dict[str, int]:
    """Return the number of presses by the identity of the calibration.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, or has a newer version.
    """
    path = folder / FILE
    try:
        return _parse(parse_json(read_file(path, SIZE_LIMIT)), path)
    except FileNotFoundError:
        return {}
    except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise InputError(
            tr("The list of presses cannot be read ({error})").format(error=brief(str(error), 200)),
            where=str(path),
            advice=tr("Repair the file, or delete it to count from 0"),
        ) from error


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
    write_bytes(folder / FILE, (json.dumps(content, indent=1) + "\n").encode())


def _parse(content: Any, path: Path) -> dict[str, int]:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ValueError("it is not a list of presses")
    version = content["version"]
    if type(version) is int and VERSION < version < NEWEST:
        raise InputError(
            tr(
                "The list of presses has version {v}, but this program supports only version {k}"
            ).format(v=version, k=VERSION),
            where=str(path),
            advice=tr("Use a newer version of GelPoLight Studio"),
        )
    rows = content["calibrations"].items()
    return {plain_text(identity): _presses(row["presses"]) for identity, row in rows}


def _presses(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= MOST_PRESSES:
        raise ValueError(f"{brief(value)} is not a number of presses")
    return value
