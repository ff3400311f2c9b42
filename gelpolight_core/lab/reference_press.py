"""One press of a known object, and ``truth.csv``, which has a row for each."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from gelpolight_core.base.compared_quantity import (
    COVERAGE,
    TOLERANCE_PERCENT,
    Quantity,
    percent_error,
)
from gelpolight_core.base.csv_table import read_csv
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.number import read_number
from gelpolight_core.base.safe_reading import is_file_name, short_repr
from gelpolight_core.measurement.indenter_models import MODELS
from gelpolight_core.measurement.result import Measurement, compare_with_truth
from gelpolight_core.session.inventory import SessionInventory
from gelpolight_core.session.reference_object import RANGE_MM, ReferenceObject, checked_day
from gelpolight_core.session.session import INDENTERS, parse_indenters

LONGEST_MM, SHORTEST_MM = RANGE_MM[1], math.ulp(0.0)
NEEDED = ("file", "shape", "height_mm")
TRUTH = "truth.csv"
INDENTER = "indenter"
"""The column that names an object of ``[indenters]``, from which a row takes its empty cells."""
LENGTHS: Mapping[str, str] = MappingProxyType({"planar": "size_mm", "depth": "height_mm"})
"""The length that is judged in each direction of the evaluation."""


@dataclass(frozen=True, slots=True)
class ReferencePress:
    """One press of an object of known size, before or after its measurement.

    Attributes
    ----------
    file : str
        Image, without its folder.
    truth : ReferenceObject
        Nominal sizes.
    position_mm : (float, float)
        Where its middle is stated to be, (x, y) in the sensor frame.
    position_sd_mm : float or None
        Standard deviation of a stated position along each axis; None: it is not known.
    outcome : Measurement or str
        The measurement, or the sentence why there is none; empty before.
    """

    file: str
    truth: ReferenceObject
    position_mm: tuple[float, float] = (0.0, 0.0)
    position_sd_mm: float | None = None
    outcome: Measurement | str = field(default="", compare=False)

    @property
    def measurement(self) -> Measurement | None:
        """The measurement, if there is one."""
        return None if isinstance(self.outcome, str) else self.outcome

    def true_mm(self, direction: str) -> float:
        """Return the nominal size (``planar``) or height (``depth``), 0 if it is not stated."""
        return float(getattr(self.truth, LENGTHS[direction]))

    def measured_mm(self, direction: str) -> float:
        """Return the measured size or height, NaN without a measurement."""
        return float(getattr(self.measurement, LENGTHS[direction], math.nan))

    def error_percent(self, direction: str) -> float:
        """Return the signed error of size or height, NaN where it is not known."""
        true_mm = self.true_mm(direction)
        return percent_error(self.measured_mm(direction), true_mm) if true_mm else math.nan

    def quantities(
        self, limits_percent: tuple[float, float] = TOLERANCE_PERCENT
    ) -> dict[str, Quantity]:
        """Return size and height beside their references by direction, none if not measured."""
        if self.measurement is None:
            return {}
        quantities = compare_with_truth(self.measurement, self.truth, limits_percent)
        return dict(zip(LENGTHS, quantities, strict=True))

    def as_row(self, limits_percent: tuple[float, float] = TOLERANCE_PERCENT) -> dict[str, Any]:
        """Return the press as one line of the evaluation's tables. None stands for not known."""
        quantities, lengths = self.quantities(limits_percent), dict[str, Any]()
        for direction, key in LENGTHS.items():
            quantity = quantities.get(direction)
            lengths |= {
                f"true_{key}": self.true_mm(direction) or None,
                key: quantity and quantity.value,
                key.replace("_mm", "_sd_mm"): quantity and quantity.sd,
                f"{direction}_error_percent": quantity and quantity.error_percent,
                f"{direction}_expanded_mm": quantity and quantity.deviation_expanded,
                f"{direction}_en": quantity and quantity.en,
                f"{direction}_decision": quantity and quantity.decision,
            }
        measured = self.measurement
        return {
            "file": self.file,
            "shape": self.truth.shape,
            **lengths,
            "verdict": measured.verdict if measured else "not measured",
            "reason": measured.reason if measured else self.outcome,
        }


@dataclass(frozen=True, slots=True)
class TruthTable:
    """The presses of a folder.

    Attributes
    ----------
    rows : tuple of ReferencePress
        Cylinders, cuboids and balls.
    skipped : tuple of str
        Files of other shapes, which have no size to compare.
    """

    rows: tuple[ReferencePress, ...]
    skipped: tuple[str, ...]


def read_truth(path: Path) -> TruthTable:
    """Read ``truth.csv`` (file, shape, diameter_mm, side_mm, height_mm).

    Further columns state the reference: standard uncertainties (k = 1) ``diameter_sd_mm``,
    ``side_sd_mm`` and ``height_sd_mm``, its edge ``edge_radius_mm`` and ``edge_radius_sd_mm``,
    ``certificate``, ``due`` (a day, such as 2027-03-31) and ``serial``. A row that names an
    ``indenter`` of the session takes its empty cells from there.

    Parameters
    ----------
    path : Path
        The file, or the folder that holds ``truth.csv``.

    Raises
    ------
    InputError
        No such file, not text, a missing column, a missing, bad, zero or negative number, a file
        named twice, or no row to measure.
    """
    path = path / TRUTH if path.is_dir() else path
    table = _table(path)
    if not table.rows:
        raise InputError("no row with a cylinder, cuboid or ball", path, Remedy.TRUTH_ROW)
    return table


def listed_presses(folder: Path) -> tuple[ReferencePress, ...]:
    """Return the presses that ``truth.csv`` of a folder lists, none without the file.

    Raises
    ------
    InputError
        If the file cannot be used.
    """
    path = folder / TRUTH
    return _table(path).rows if path.is_file() else ()


def _table(path: Path) -> TruthTable:
    records = _records(path)
    if any(record.get(INDENTER) for _, record in records):
        indenters = parse_indenters(SessionInventory(path.parent.parent))
        records = [(line, _completed(record, indenters, path, line)) for line, record in records]
    rows: list[ReferencePress] = []
    skipped: list[str] = []
    files: set[str] = set()
    for line, record in records:
        where = f"{path}, line {line}"
        file, shape = record.get("file", ""), record.get("shape", "").lower()
        fault = _file_fault(file, files)
        if fault is not None:
            raise InputError(fault[0], where, fault[1])
        files.add(file)
        if shape in MODELS:
            rows.append(_press(file, shape, record, where))
        else:
            skipped.append(file)
    return TruthTable(tuple(rows), tuple(skipped))


def _file_fault(file: str, seen: Collection[str]) -> tuple[str, str] | None:
    """Return the fault of an image's name with its remedy, None if there is none."""
    if not file:
        return "a row names no file", "Name the image of the press"
    if not is_file_name(file):
        text = f"'{short_repr(file)}' is not the name of an image in this folder"
        return text, "Put the image beside truth.csv, and name it without a folder"
    if file in seen:
        return f"{file} is listed twice", "Keep one row for each image"
    return None


def _records(path: Path) -> list[tuple[int, dict[str, str]]]:
    """Return the rows with their line numbers, keys and values stripped."""
    try:
        numbered = read_csv(path)
    except FileNotFoundError as error:
        raise InputError(
            "The file does not exist",
            str(path),
            "Put a truth.csv with the columns file,shape,diameter_mm,side_mm,height_mm there",
        ) from error
    header = [name.strip() for name in numbered[0][1]] if numbered else []
    missing = [name for name in NEEDED if name not in header]
    if INDENTER in header:
        missing = [name for name in missing if name == "file"]
    elif not {"diameter_mm", "side_mm"} & set(header):
        missing.append("diameter_mm")
    if missing:
        text = f"the column {', '.join(missing)} is missing in the first line"
        raise InputError(text, path, Remedy.CORRECT_FILE)
    return [
        (line, dict(zip(header, (cell.strip() for cell in cells), strict=False)))
        for line, cells in numbered[1:]
    ]


def _completed(
    record: dict[str, str], known: Mapping[str, Mapping[str, Any]], path: Path, line: int
) -> dict[str, str]:
    """Return a row whose empty cells come from the indenter that it names."""
    name = record.get(INDENTER, "")
    if name and name not in known:
        raise InputError(
            f"'{short_repr(name)}' is not an indenter of session.toml",
            f"{path}, line {line}",
            Remedy.ONE_OF.format(names=", ".join(known) or f"[{INDENTERS}]"),
        )
    cells = {key: str(value) for key, value in known.get(name, {}).items()}
    return cells | {key: cell for key, cell in record.items() if cell}


def _press(file: str, shape: str, record: dict[str, str], where: str) -> ReferencePress:
    size, other = ("side", "diameter") if shape == "cuboid" else ("diameter", "side")

    def optional(key: str) -> float:
        return _length(record, key, where, 0.0) if record.get(key) else 0.0

    truth = ReferenceObject(
        shape,
        _length(record, f"{size}_mm", where),
        size_expanded_mm=COVERAGE * optional(f"{size}_sd_mm"),
        height_mm=_length(record, "height_mm", where) if record.get("height_mm") else 0.0,
        height_expanded_mm=COVERAGE * optional("height_sd_mm"),
        edge_radius_mm=optional("edge_radius_mm"),
        edge_radius_expanded_mm=COVERAGE * optional("edge_radius_sd_mm"),
        certificate=record.get("certificate", ""),
        due=checked_day(record.get("due", ""), where),
        serial=record.get("serial", ""),
    )
    if text := record.get(f"{other}_mm"):
        message = f"{other}_mm is '{short_repr(text)}', which is no size of a {shape}"
        raise InputError(message, where, Remedy.WRITE_POINT)
    if not record.get("position_sd_mm"):
        return ReferencePress(file, truth)
    x, y = (_length(record, key, where, -LONGEST_MM) for key in ("x_mm", "y_mm"))
    return ReferencePress(
        file, truth, (x, y), position_sd_mm=_length(record, "position_sd_mm", where)
    )


def _length(record: dict[str, str], key: str, where: str, least_mm: float = SHORTEST_MM) -> float:
    text = record.get(key, "")
    value = read_number(text, f"{where}, {key}") if text else math.nan
    if least_mm <= value <= LONGEST_MM:
        return value
    message = f"{key} is '{short_repr(text)}'" if text else f"{key} is empty"
    advice = Remedy.CORRECT_VALUE if least_mm <= 0.0 else "Give a length in mm greater than zero"
    if value > LONGEST_MM:
        advice = f"Give a length of at most {LONGEST_MM:g} mm"
    raise InputError(message, where, advice)
