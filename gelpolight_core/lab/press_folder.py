"""A folder of presses: images, and ``truth.csv`` with a row for each press, made or still to make.

A press whose image is missing is still to be made. Nothing else is stored, so that a list of
presses can be continued at any time.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gelpolight_core.base.atomic_write import make_folder, write_text
from gelpolight_core.base.csv_table import csv_text, read_csv
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.session.reference_object import LENGTH_KEYS, TEXT_KEYS, ReferenceObject

from .reference_press import TRUTH, read_truth

FOLDER = "presses"
COLUMNS = ("file", *dict.fromkeys((TEXT_KEYS[0], *LENGTH_KEYS, *TEXT_KEYS)))
TruthRow = dict[str, str]


def presses_folder(folder: Path) -> Path:
    """Return the folder with ``truth.csv``: this one, or ``presses`` inside it.

    Raises
    ------
    InputError
        If ``truth.csv`` cannot be used.
    """
    inner = folder / FOLDER
    presses = inner if not (folder / TRUTH).is_file() and (inner / TRUTH).is_file() else folder
    read_truth(presses)
    return presses


def add_presses(folder: Path, truth: ReferenceObject, count: int) -> tuple[str, ...]:
    """List more presses of an object in ``truth.csv``, and return the names of their images.

    Parameters
    ----------
    folder : Path
        Created if it is missing.
    truth : ReferenceObject
        The object; its size must be stated.
    count : int
        How often it is pressed.

    Raises
    ------
    InputError
        If the size is not stated, or the file cannot be read or written.
    """
    if not truth.size_mm:
        raise InputError("The object has no size", TRUTH, "Enter its diameter or side")
    make_folder(folder)
    cells = {key: str(value) for key, value in truth.as_json().items()}
    depth = f"x{truth.height_mm:g}" if truth.height_mm else ""
    files: list[str] = []

    def add(rows: list[TruthRow]) -> list[TruthRow]:
        taken = {row.get("file", "") for row in rows} | {path.name for path in folder.iterdir()}
        for number in range(1, len(taken) + count + 1):
            file = f"{truth.shape}_{truth.mean_size_mm:g}{depth}_{number}.png"
            if file not in taken and len(files) < count:
                files.append(file)
        return [*rows, *({"file": file, **cells} for file in files)]

    _change(folder / TRUTH, add)
    return tuple(files)


def leave_out(folder: Path, file: str) -> None:
    """Remove a press from ``truth.csv``. Its image stays in the folder.

    Raises
    ------
    InputError
        If the file cannot be read or written.
    """
    _change(folder / TRUTH, lambda rows: [row for row in rows if row.get("file") != file])


def _change(path: Path, change: Callable[[list[TruthRow]], list[TruthRow]]) -> None:
    """Write other rows. Columns and cells that are already there are kept."""
    numbered = read_csv(path) if path.is_file() else [(1, list(COLUMNS))]
    header = [name.strip() for name in numbered[0][1]] if numbered else []
    if "file" not in header:
        raise InputError("the column file is missing in the first line", path, Remedy.CORRECT_FILE)
    rows = [dict(zip(header, map(str.strip, cells), strict=False)) for _, cells in numbered[1:]]
    columns = list(dict.fromkeys((*header, *COLUMNS)))
    cells = ([row.get(column, "") for column in columns] for row in change(rows))
    write_text(path, csv_text(columns, cells))
