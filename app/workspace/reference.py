"""What is stated of a reference object: the fields of every form that asks for one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from app.widgets.fields import When, number
from gelpolight_core.measurement.result import Truth
from gelpolight_core.quantity import COVERAGE
from gelpolight_core.translation import tr

LARGEST_MM = 500.0
MM = tr(" mm")


def optional_length(label: str, none: str, *, tip: str = "", when: When | None = None) -> Any:
    """Return the field for a length that need not be stated."""
    span, step = (0.0, LARGEST_MM), 0.1
    return number(0.0, label, *span, MM, 3, step=step, none=none, tip=tip, when=when)


def uncertainty(of: str) -> Any:
    """Return the field for the uncertainty of another one, shown where that is stated."""
    return number(
        0.0,
        tr("± U (k = 2)"),
        0.0,
        LARGEST_MM,
        MM,
        4,
        step=0.001,
        none=tr("not stated"),
        tip=tr("Expanded uncertainty on the certificate of the reference"),
        when=lambda stated: bool(getattr(stated, of)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """The true values of an object, as the user states them. 0 or empty: not stated.

    Attributes
    ----------
    name : str
        Name of the known object. Empty if the numbers were typed.
    shape : str
        Only where the form asks for it.
    size_mm : float
        The diameter, the mean side, or the tool's first figure in its own unit.
    second_mm : float
        The other side of a cuboid, in the list of known objects.
    height_mm : float
        Indentation depth.
    edge_radius_mm : float
        Fillet of the edge. If it is not stated, it is fitted.
    size_expanded_mm, height_expanded_mm, edge_radius_expanded_mm : float
        Their expanded uncertainties (k = 2).
    certificate, due, serial : str
        As in :class:`~gelpolight_core.measurement.result.Truth`.
    """

    name: str = ""
    shape: str = ""
    size_mm: float = optional_length(tr("Size"), tr("not known"))
    second_mm: float = 0.0
    size_expanded_mm: float = uncertainty("size_mm")
    height_mm: float = optional_length(tr("Depth"), tr("not known"))
    height_expanded_mm: float = uncertainty("height_mm")
    edge_radius_mm: float = optional_length(tr("Edge radius"), tr("fitted"))
    edge_radius_expanded_mm: float = uncertainty("edge_radius_mm")
    certificate: str = ""
    due: str = ""
    serial: str = ""

    @property
    def edge_mm(self) -> tuple[float | None, float | None]:
        """Radius of the edge and its standard uncertainty; None where it is not stated."""
        return self.edge_radius_mm or None, self.edge_radius_expanded_mm / COVERAGE or None

    def truth(self, shape: str) -> Truth:
        """Return it as the reference of a shape."""
        return Truth(
            shape,
            self.size_mm or math.nan,
            self.height_mm or math.nan,
            self.size_expanded_mm / COVERAGE or None,
            self.height_expanded_mm / COVERAGE or None,
            *self.edge_mm,
            self.certificate,
            self.due,
            self.serial,
        )
