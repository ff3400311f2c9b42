"""The lab's known indenters: ``indenters.json`` of the workspace."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import make_folder, write_json
from gelpolight_core.io.reading import NAME_LIMIT, brief, plain_text, read_own
from gelpolight_core.measurement.measure import SHAPES
from gelpolight_core.measurement.result import checked_day
from gelpolight_core.translation import tr

FILE = "indenters.json"
FORMAT = "gelpolight-indenters"
VERSION = 1
OPTIONAL = (
    "second_mm",
    "height_mm",
    "edge_radius_mm",
    "size_expanded_mm",
    "height_expanded_mm",
    "edge_radius_expanded_mm",
)
TEXTS = ("certificate", "due", "serial")
"""What need not be stated of an indenter."""


@dataclass(frozen=True, slots=True)
class Indenter:
    """An object of known size.

    Attributes
    ----------
    name : str
        Its name in the lab.
    shape : str
        ``ball``, ``cylinder`` or ``cuboid``.
    size_mm : float
        Diameter, or side of a cuboid.
    second_mm : float or None
        The other side of a cuboid that is not square.
    height_mm : float or None
        Indentation depth when its base touches. None if it has no such base.
    edge_radius_mm : float or None
        Fillet of its edge. None if it is not known.
    size_expanded_mm, height_expanded_mm, edge_radius_expanded_mm : float or None
        Expanded uncertainties (k = 2). None if they are not stated.
    certificate, due, serial : str
        Number of its certificate, the day on which its calibration ends, such as ``2027-03-31``,
        and its own number. Empty if not stated.

    Raises
    ------
    InputError
        If it has no name, the shape is unknown, a length is not greater than zero, or `due` is no
        day.
    """

    name: str
    shape: str
    size_mm: float
    second_mm: float | None = None
    height_mm: float | None = None
    edge_radius_mm: float | None = None
    size_expanded_mm: float | None = None
    height_expanded_mm: float | None = None
    edge_radius_expanded_mm: float | None = None
    certificate: str = ""
    due: str = ""
    serial: str = ""

    def __post_init__(self) -> None:
        """Check the values."""
        where = tr("indenter {name}").format(name=self.name or tr("without a name"))
        if not self.name.strip():
            raise InputError(tr("An indenter has no name"), where, Remedy.CHOOSE_NAME)
        if self.shape not in SHAPES:
            raise InputError(
                tr("Unknown shape '{shape}'").format(shape=self.shape),
                where,
                Remedy.ONE_OF.format(names=", ".join(SHAPES)),
            )
        checked_day(self.due, where)
        for length in (self.size_mm, *(getattr(self, name) for name in OPTIONAL)):
            if length is not None and not (math.isfinite(length) and length > 0.0):
                raise InputError(
                    tr("The length {value} mm is not greater than zero").format(value=length),
                    where,
                    Remedy.CORRECT_VALUE,
                )

    @property
    def mean_size_mm(self) -> float:
        """The diameter, or the mean side."""
        second = self.size_mm if self.second_mm is None else self.second_mm
        return (self.size_mm + second) / 2.0


def first_indenters() -> tuple[Indenter, ...]:
    """Return the default list: the indenters of the paper's evaluation."""
    rows = [
        Indenter(
            tr("{shape} {size:g} mm, {height:g} mm high").format(
                shape=text, size=size, height=height
            ),
            shape,
            size,
            height_mm=height,
        )
        for shape, text in (("cylinder", tr("Cylinder")), ("cuboid", tr("Cuboid")))
        for size, height in (
            *((size, 1.0) for size in (3.0, 4.0, 5.0, 6.0, 7.0)),
            *((5.0, height) for height in (0.5, 0.75, 1.25, 1.5)),
        )
    ]
    return (*rows, Indenter(tr("Ball 8 mm"), "ball", 8.0))


def read_indenters(folder: Path) -> tuple[Indenter, ...]:
    """Read the list of a workspace. Default: the list of the paper's indenters.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, or has a newer version.
    """
    found = read_own(
        folder / FILE,
        (FORMAT, VERSION),
        _parse,
        found=tr("The list of indenters cannot be read ({error})"),
    )
    return first_indenters() if found is None else found


def _parse(content: Any) -> tuple[Indenter, ...]:
    return tuple(
        Indenter(
            plain_text(row["name"], NAME_LIMIT),
            plain_text(row["shape"], NAME_LIMIT),
            _length(row["size_mm"]),
            **_stated(row),
        )
        for row in content["indenters"]
    )


def _stated(row: dict[str, Any]) -> dict[str, Any]:
    lengths = {name: _length(row[name]) for name in OPTIONAL if row.get(name) is not None}
    return lengths | {name: plain_text(row[name], NAME_LIMIT) for name in TEXTS if name in row}


def write_indenters(indenters: Iterable[Indenter], folder: Path) -> None:
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
            raise InputError(
                tr("Two indenters have the name {name}").format(name=name),
                tr("List of indenters"),
                Remedy.CHOOSE_NAME,
            )
    content = {"format": FORMAT, "version": VERSION, "indenters": [asdict(row) for row in rows]}
    make_folder(folder)
    write_json(folder / FILE, content)


def _length(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{brief(value)} is not a length")
    return float(value) if abs(value) < 10_000.0 else math.inf
