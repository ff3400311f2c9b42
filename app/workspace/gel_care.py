"""How the gel was used since each calibration: presses, and how fast it recovers from them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from app.workspace.files import write_bytes
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.reading import NEWEST, brief, parse_json, plain_text, read_file
from gelpolight_core.translation import tr

FILE = "gel-care.json"
FORMAT = "gelpolight-gel-care"
VERSION = 1
SIZE_LIMIT = 4_000_000
MOST_PRESSES = 10**9
LONGEST_S = 3600.0
KEPT = 10
"""Recovery times that are kept, of the first and of the last presses."""


@dataclass(frozen=True, slots=True)
class GelCare:
    """Use of the gel since one calibration.

    Attributes
    ----------
    presses : int
        Presses seen on the Inspect and Measure pages.
    first_s, last_s : tuple of float
        Recovery times of the first and of the last of them, in their order.
    """

    presses: int = 0
    first_s: tuple[float, ...] = ()
    last_s: tuple[float, ...] = ()

    @property
    def early_s(self) -> float | None:
        """Typical recovery time of the first presses. None if it is not known."""
        return median(self.first_s) if self.first_s else None

    @property
    def lately_s(self) -> float | None:
        """Typical recovery time of the last presses. None if it is not known."""
        return median(self.last_s) if self.last_s else None

    def later(self, presses: int, recoveries_s: tuple[float, ...]) -> GelCare:
        """Return the use after more presses, with those recovery times that were seen."""
        first = (*self.first_s, *recoveries_s)[:KEPT]
        return GelCare(self.presses + presses, first, (*self.last_s, *recoveries_s)[-KEPT:])


def read_gel_care(folder: Path) -> dict[str, GelCare]:
    """Return the use of the gel by the identity of the calibration.

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


def write_gel_care(care: Mapping[str, GelCare], folder: Path) -> None:
    """Write the use of the gel, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    rows = {identity: asdict(one) for identity, one in care.items()}
    content = {"format": FORMAT, "version": VERSION, "calibrations": rows}
    make_folder(folder)
    write_bytes(folder / FILE, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def _parse(content: Any, path: Path) -> dict[str, GelCare]:
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
    return {
        plain_text(identity): GelCare(
            _presses(row["presses"]), _times(row["first_s"]), _times(row["last_s"])
        )
        for identity, row in content["calibrations"].items()
    }


def _presses(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= MOST_PRESSES:
        raise ValueError(f"{brief(value)} is not a number of presses")
    return value


def _times(values: Any) -> tuple[float, ...]:
    times = tuple(float(value) for value in values)
    if len(times) > KEPT or not all(math.isfinite(t) and 0.0 <= t <= LONGEST_S for t in times):
        raise ValueError(f"{brief(values)} are not recovery times")
    return times
