"""Calibration folders of other open libraries: their images, balls and circles.

Three forms are known: ``catalog.csv`` with a folder for each press (gs_sdk), ``annotations/`` with
``probe_images/`` (py3DCal), and ``annotate.csv`` beside the images (digit-depth).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from os.path import isfile
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np

from gelpolight_core.base.csv_table import read_csv
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.npy import read_arrays
from gelpolight_core.base.number import read_number
from gelpolight_core.base.safe_reading import parse_json, read_file, short_repr
from gelpolight_core.session.decisions import PlacedCircle

MOST_FRAMES = 80
"""Most images used, evenly selected, from folders with thousands of images of a robot's raster."""
TABLE_LIMIT = 20_000_000
RADIUS_RANGE = (0.05, 500.0)
FORMS = "catalog.csv, annotations/annotations.csv, annotate.csv"


@dataclass(frozen=True, slots=True)
class ImportedPress:
    """An image of a pressed ball in a folder of another library.

    Attributes
    ----------
    image : Path
        Its file.
    radius_mm : float or None
        Radius of the ball; None where the folder does not state it.
    circle : PlacedCircle or None
        The contact labelled by a person.
    """

    image: Path
    radius_mm: float | None
    circle: PlacedCircle | None = None


@dataclass(frozen=True, slots=True)
class ImportedCalibration:
    """The content of a calibration folder of another library.

    Attributes
    ----------
    form : str
        The table by which it was recognised.
    presses : tuple of ImportedPress
        In the order of the table.
    background : Path or None
        The untouched membrane, where the folder has it.
    mm_per_px : float or None
        The scale, where the folder states it.
    """

    form: str
    presses: tuple[ImportedPress, ...]
    background: Path | None
    mm_per_px: float | None = None


def read_foreign(folder: Path) -> ImportedCalibration:
    """Read a calibration folder of another library.

    Parameters
    ----------
    folder : Path
        With ``catalog.csv``, ``annotations/annotations.csv`` or ``annotate.csv``.

    Raises
    ------
    InputError
        If it has none of these, or a line, an image or a label cannot be used.
    """
    for table, read in (
        (folder / "catalog.csv", _catalog),
        (folder / "annotations" / "annotations.csv", _annotations),
        (folder / "annotate.csv", _annotate),
    ):
        if table.is_file():
            content = read(folder, table)
            break
    else:
        raise _unusable(f"The folder has none of {FORMS}", folder)
    if not content.presses:
        raise _unusable("The table lists no image", table)
    return content


def _unusable(text: str, where: Path | str) -> InputError:
    return InputError(text, where, Remedy.CHOOSE_FOLDER)


def _wrong_line(text: str, where: str) -> InputError:
    return InputError(text, where, Remedy.CORRECT_ENTRY)


def _catalog(folder: Path, table: Path) -> ImportedCalibration:
    """Read gs_sdk's form: a folder of each press, with ``gelsight.png`` and ``label.npz``."""
    presses = []
    for number, row in _rows(table, ("experiment_reldir", "diameter(mm)")):
        where = f"{table}, line {number}"
        press = _inside(folder, row["experiment_reldir"], where)
        radius = 0.5 * _number(row["diameter(mm)"], where, *(2.0 * r for r in RADIUS_RANGE))
        label = press / "label.npz"
        circle = _label(label) if isfile(label) else None
        presses.append(ImportedPress(_image(press / "gelsight.png", where), radius, circle))
    return ImportedCalibration(table.name, tuple(presses), _if_there(folder / "background.png"))


def _annotations(folder: Path, table: Path) -> ImportedCalibration:
    """Read py3DCal's form: a robot's raster of one ball, many frames at each place.

    Its circles have the radius of the ball, not of the contact, and are not used.
    """
    about = folder / "annotations" / "metadata.json"
    try:
        metadata = parse_json(read_file(about))
        radius = _number(metadata["probe_radius_mm"], str(about), *RADIUS_RANGE)
        scale = 1.0 / _number(metadata["px_per_mm"], str(about), 0.1, 1e4)
    except (FileNotFoundError, ValueError, KeyError, TypeError) as error:
        text = "The file does not state px_per_mm and probe_radius_mm"
        raise _unusable(text, about) from error
    paths: dict[tuple[str, str], Path] = {}
    for number, row in _rows(table, ("img_name", "x_mm", "y_mm")):
        where = f"{table}, line {number}"
        image = _inside(folder / "probe_images", row["img_name"], where)
        paths.setdefault((row["x_mm"], row["y_mm"]), _image(image, where))
    images = list(paths.values())
    selected = np.linspace(0, len(images) - 1, min(MOST_FRAMES, len(images))).round().astype(int)
    return ImportedCalibration(
        table.name,
        tuple(ImportedPress(images[i], radius) for i in selected),
        _if_there(folder / "blank_images" / "blank.png"),
        scale,
    )


def _annotate(folder: Path, table: Path) -> ImportedCalibration:
    """Read digit-depth's form: lines of image, x, y and radius of the contact in pixels."""
    presses = []
    for number, row in read_csv(table, TABLE_LIMIT):
        where = f"{table}, line {number}"
        if number == 1 and len(row) == 4 and not row[1][:1].isdecimal():
            continue
        if len(row) != 4:
            raise _wrong_line(f"The line has {len(row)} values, not image, x, y and radius", where)
        # The table contains paths of the computer on which it was made.
        name = PureWindowsPath(PurePosixPath(row[0]).name).name
        paths = (folder / name, folder / "images" / name)
        image = next((path for path in paths if isfile(path)), paths[0])
        circle = PlacedCircle(*(_number(value, where, 0.0, 1e5) for value in row[1:]))
        presses.append(ImportedPress(_image(image, where), None, circle))
    return ImportedCalibration(table.name, tuple(presses), _if_there(folder / "background.png"))


def _rows(table: Path, columns: tuple[str, ...]) -> list[tuple[int, Mapping[str, str]]]:
    """Return the numbered lines of a table, which must have the given columns."""
    (_, head), *lines = read_csv(table, TABLE_LIMIT) or [(1, [])]
    for name in columns:
        if name not in head:
            raise _unusable(f"The table has no column {name}", table)
    indices = {name: head.index(name) for name in columns}
    for number, line in lines:
        if len(line) <= max(indices.values()):
            raise _wrong_line("The line has too few values", f"{table}, line {number}")
    return [(number, {key: line[i] for key, i in indices.items()}) for number, line in lines]


def _label(path: Path) -> PlacedCircle:
    """Return the circle of a label file: arrays ``center`` and ``radius``, pixels."""
    try:
        label = read_arrays(path, ("center", "radius"))
        x, y = label["center"].astype(np.float64).ravel()
        radius = float(label["radius"].astype(np.float64).reshape(()))
        if not all(map(math.isfinite, (x, y, radius))) or radius <= 0.0:
            raise ValueError(radius)
    except (FileNotFoundError, ValueError, KeyError) as error:
        text = "The label contains no circle (center, radius)"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error
    return PlacedCircle(float(x), float(y), radius)


def _inside(folder: Path, name: str, where: str) -> Path:
    """Return a file or folder that a table names, which must be inside its folder."""
    path = folder / PureWindowsPath(name).as_posix()
    if not path.resolve().is_relative_to(folder.resolve()):
        raise _wrong_line(f"The line names a path outside the folder: {short_repr(name)}", where)
    return path


def _image(path: Path, where: str) -> Path:
    if not isfile(path):  # False for any name that no disk takes
        raise _wrong_line(f"The image {short_repr(str(path), 300)} does not exist", where)
    return path


def _if_there(path: Path) -> Path | None:
    return path if path.is_file() else None


def _number(value: object, where: str, low: float, high: float) -> float:
    number = read_number(value, where) if isinstance(value, str) else value
    if not isinstance(number, int | float) or not low <= number <= high:
        raise _wrong_line(
            f"{short_repr(value, 40)} is not a number from {low:g} to {high:g}", where
        )
    return float(number)
