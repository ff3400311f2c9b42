"""Reference objects of known size, as forms and files state them."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, fields
from datetime import date
from pathlib import Path
from typing import Any

from gelpolight_core.base.compared_quantity import COVERAGE
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.base.form_fields import When, choice, is_possible, limit_of, number, text
from gelpolight_core.base.safe_reading import short_repr

SHAPES = {"cylinder": "Cylinder", "cuboid": "Cuboid", "ball": "Ball"}
WALLED = ("cylinder", "cuboid")
"""Shapes with walls, which have an edge; they are steeper than a ball."""
EXPANDED = "± U (k = 2)"
"""Label of an expanded uncertainty."""
FACE_TO_BASE = "Height of the object from its face to its base, if it has one"
RANGE_MM = (0.0, 1000.0)
"""Range of every length."""
LENGTH_KEYS = tuple(
    f"{name}{end}"
    for name in ("diameter", "side", "height", "edge_radius")
    for end in ("_mm", "_sd_mm")
)
TEXT_KEYS = ("shape", "certificate", "due", "serial")
"""What ``[indenters]`` and the columns of ``truth.csv`` state of an object."""


def _length(label: str, none: str, *, tip: str = "", when: When | None = None) -> Any:
    return number(0.0, label, *RANGE_MM, " mm", 3, step=0.1, none=none, tip=tip, when=when)


def _expanded(when: When | None = None) -> Any:
    tip = "Expanded uncertainty (k = 2) on the certificate of the reference"
    how: dict[str, Any] = {"none": "not stated", "tip": tip, "beside": EXPANDED, "when": when}
    return number(0.0, EXPANDED, *RANGE_MM, " mm", 4, step=0.001, **how)


def _is_shape(stated: ReferenceObject) -> bool:
    return stated.shape in SHAPES


def _has_walls(stated: ReferenceObject) -> bool:
    return stated.shape in WALLED


@dataclass(frozen=True, slots=True, kw_only=True)
class _Named:
    """Its name comes first in forms."""

    name: str = text("", "Name")


@dataclass(frozen=True, slots=True)
class ReferenceObject(_Named):
    """The true values of an object as they are stated. 0 or empty: not stated.

    Attributes
    ----------
    name : str
        Name of a known object; empty if the values were typed.
    shape : str
        ``cylinder``, ``cuboid`` or ``ball``; the name of a tool that measures something else.
    size_mm, second_mm : float
        Diameter, or the sides of a cuboid, the second if it is not square; the first figure of
        another tool, in its unit.
    height_mm : float
        Indentation depth, when its base touches.
    edge_radius_mm : float
        Fillet of the edge. If it is not stated, it is fitted.
    size_expanded_mm, height_expanded_mm, edge_radius_expanded_mm : float
        Their expanded uncertainties (k = 2).
    certificate, serial : str
        Number of its calibration certificate, and its own.
    due : str
        Day on which its calibration ends, such as ``2027-03-31``.
    """

    shape: str = choice("cylinder", "Shape", SHAPES)
    size_mm: float = _length("Diameter or side", "not known")
    _: KW_ONLY
    size_expanded_mm: float = _expanded()
    second_mm: float = _length("Other side", "the same", when=lambda one: one.shape == "cuboid")
    height_mm: float = _length("Height", "not known", tip=FACE_TO_BASE, when=_is_shape)
    height_expanded_mm: float = _expanded(_is_shape)
    edge_radius_mm: float = _length("Edge radius", "fitted", when=_has_walls)
    edge_radius_expanded_mm: float = _expanded(_has_walls)
    certificate: str = text("", "Certificate", "Number of its calibration certificate")
    due: str = text("", "Due on", "End of its calibration, such as 2027-03-31")
    serial: str = text("", "Serial number")

    @property
    def mean_size_mm(self) -> float:
        """The diameter, or the mean side."""
        second = self.second_mm if self.shape == "cuboid" else 0.0
        return (self.size_mm + (second or self.size_mm)) / 2.0

    @property
    def size_key(self) -> str:
        """The name under which the size is written: ``side_mm`` or ``diameter_mm``."""
        return "side_mm" if self.shape == "cuboid" else "diameter_mm"

    @property
    def size_sd_mm(self) -> float | None:
        """Standard uncertainty of the size, or None where it is not stated."""
        return self.size_expanded_mm / COVERAGE or None

    @property
    def height_sd_mm(self) -> float | None:
        """Standard uncertainty of the height, or None where it is not stated."""
        return self.height_expanded_mm / COVERAGE or None

    @property
    def edge_mm(self) -> tuple[float | None, float | None]:
        """Radius of the edge with its standard uncertainty, each None where it is not stated."""
        if self.shape not in WALLED:
            return None, None
        return self.edge_radius_mm or None, self.edge_radius_expanded_mm / COVERAGE or None

    @property
    def is_whole(self) -> bool:
        """Whether both sizes are known."""
        return bool(self.size_mm and self.height_mm)

    def findings(self) -> tuple[Finding, ...]:
        """Return what is wrong with the reference today."""
        if not self.due or date.fromisoformat(self.due) >= date.today():
            return ()
        which = self.certificate or self.serial or self.name
        text = f"the calibration of {f'the reference {which}'.rstrip()} ended on {self.due}"
        remedy = "Have the reference calibrated again, or use another one"
        return (Finding("reference_due", text, verdict=Verdict.WARN, remedy=remedy),)

    def as_json(self) -> dict[str, Any]:
        """Return what is stated under the keys of ``truth.csv``, with the mean side of a cuboid."""
        edge_mm, edge_sd_mm = self.edge_mm
        values = {
            "shape": self.shape,
            self.size_key: self.mean_size_mm,
            self.size_key.replace("_mm", "_sd_mm"): self.size_sd_mm,
            "height_mm": self.height_mm,
            "height_sd_mm": self.height_sd_mm,
            "edge_radius_mm": edge_mm,
            "edge_radius_sd_mm": edge_sd_mm,
            "certificate": self.certificate,
            "due": self.due,
            "serial": self.serial,
        }
        return {key: value for key, value in values.items() if value}


LENGTHS = tuple(f.name for f in fields(ReferenceObject) if f.name.endswith("_mm"))
"""Its fields that are lengths."""


def check_named(stated: ReferenceObject, file: Path | str = "") -> ReferenceObject:
    """Return a known object of the lab, which may be from a file.

    Raises
    ------
    InputError
        If it has no name or size, the shape is unknown, a length is not possible, or `due` is no
        day.
    """
    where = f"{file} indenter {stated.name or 'without a name'}".lstrip()
    if not stated.name.strip():
        raise InputError("An indenter has no name", where, Remedy.CHOOSE_NAME)
    for f in fields(stated):
        if not is_possible(f, value := getattr(stated, f.name)):
            message = f"{f.name} is {short_repr(value)}, not {limit_of(f)}"
            raise InputError(message, where, Remedy.CORRECT_VALUE)
    if not stated.size_mm:
        raise InputError("The size is 0", where, Remedy.CORRECT_VALUE)
    checked_day(stated.due, where)
    return stated


def checked_day(day: str, where: Path | str) -> str:
    """Return a day such as ``2027-03-31``, or an empty text.

    Raises
    ------
    InputError
        If it is another text.
    """
    try:
        return day and date.fromisoformat(day).isoformat()
    except ValueError as error:
        raise InputError(
            f"'{short_repr(day)}' is not a day", where, "Write it as 2027-03-31"
        ) from error
