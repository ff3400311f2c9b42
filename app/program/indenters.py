"""The lab's known indenters: ``indenters.json`` of the workspace."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from gelpolight_core.base.atomic_write import make_folder, write_json
from gelpolight_core.base.codec import unpack
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import NAME_LIMIT, plain_text, read_program_file
from gelpolight_core.session.reference_object import SHAPES, WALLED, ReferenceObject, check_named

FILE = "indenters.json"
FORMAT = "gelpolight-indenters"
VERSION = 1


def first_indenters() -> tuple[ReferenceObject, ...]:
    """Return the default list: the indenters of the paper's evaluation."""
    rows = [
        ReferenceObject(
            shape, size, height_mm=height, name=f"{SHAPES[shape]} {size:g} mm, {height:g} mm high"
        )
        for shape in WALLED
        for size, height in (
            *((size, 1.0) for size in (3.0, 4.0, 5.0, 6.0, 7.0)),
            *((5.0, height) for height in (0.5, 0.75, 1.25, 1.5)),
        )
    ]
    return (*rows, ReferenceObject("ball", 8.0, name="Ball 8 mm"))


def read_indenters(folder: Path) -> tuple[ReferenceObject, ...]:
    """Read the list of a workspace. Default: the list of the paper's indenters.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, or has a newer version.
    """
    indenters = read_program_file(
        folder / FILE,
        (FORMAT, VERSION),
        lambda content: tuple(_stated(row, folder / FILE) for row in content["indenters"]),
        found="The list of indenters cannot be read ({error})",
    )
    return first_indenters() if indenters is None else indenters


def _stated(row: dict[str, Any], file: Path) -> ReferenceObject:
    values = {
        f.name: plain_text(value, NAME_LIMIT) if isinstance(value, str) else value
        for f in fields(ReferenceObject)
        if (value := row.get(f.name)) is not None
    }
    return check_named(unpack(ReferenceObject, values, {}, "indenter"), file)


def write_indenters(indenters: Iterable[ReferenceObject], folder: Path) -> None:
    """Write the list, completely or not at all.

    Raises
    ------
    InputError
        If two indenters have the same name, or the file cannot be written.
    """
    rows = list(indenters)
    names = [row.name for row in rows]
    for name in names:
        if names.count(name) > 1:
            message = f"Two indenters have the name {name}"
            raise InputError(message, "List of indenters", Remedy.CHOOSE_NAME)
    content = {"format": FORMAT, "version": VERSION, "indenters": list(map(_row, rows))}
    make_folder(folder)
    write_json(folder / FILE, content)


def _row(indenter: ReferenceObject) -> dict[str, Any]:
    return {name: value for name, value in asdict(indenter).items() if value}
