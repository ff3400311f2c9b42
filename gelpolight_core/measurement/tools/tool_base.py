"""The base of all measuring tools: frozen geometry in mm that is applied to a height map."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import Field, dataclass, fields, replace
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.finding import Finding, doubtful_finding, join_reasons
from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.profile import Profile
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

Flags = NDArray[np.uint8]
Point = tuple[float, float]
"""(x, y) in mm in the sensor frame: the type of a tool's field that is a point."""
Range = tuple[float, float]
"""Begin and end of a part of a section, in mm from its start."""

UNKNOWN = int(Flag.SATURATED | Flag.NOT_OBSERVABLE | Flag.INVALID | Flag.UNANCHORED)
"""Flags of points whose depth is uncertain. Walls in the shadow of one LED are not among them,
because the model does not need this LED."""
POINTS = "tuple[Point, ...]"
PLACES = ("Point", "Point | None", POINTS, "Rectangle")
"""Types of the fields that are places, as they are written."""
SECTIONS = ("lines", "outlines", "features", "objects", "extensions")
"""Groups of the palette, from top to bottom."""


@dataclass(frozen=True, slots=True)
class PaletteEntry:
    """How a person chooses and places a tool.

    Attributes
    ----------
    section : str
        Group of the palette, one of `SECTIONS`.
    order : int
        Position in the group: smaller numbers are higher.
    tip : str
        What the tool measures.
    prompts : tuple of str
        What to do, one text for each click. Default: one text for all tools.
    key : str
        Key that chooses the tool; empty for none.
    label : str
        Name shown to the user. Default: the tool's name.
    icon : str
        File of ``resources/icons``, without its extension. Default: ``tool-`` and the name.
    """

    section: str = SECTIONS[-1]
    order: int = 0
    tip: str = ""
    prompts: tuple[str, ...] = ()
    key: str = ""
    label: str = ""
    icon: str = ""


@dataclass(frozen=True, slots=True)
class ToolResult:
    """The result of a tool on a height map.

    Attributes
    ----------
    tool : Tool
        The tool.
    figures : tuple of MeasuredValue
        What was measured, the most important first.
    drawing_mm : tuple of (N, 2) arrays
        Lines (x, y) to be drawn over the map.
    findings : tuple of Finding
        Why it is doubtful; empty when it is not.
    measurement : Measurement or None
        The whole fit, of a fitted indenter.
    profile : Profile or None
        The section that was read, where the tool reads one.
    width_ends : (float, float, float) or None
        Where a width begins and ends along the section, and its level in mm; of a tool that
        measures one.
    """

    tool: Tool
    figures: tuple[MeasuredValue, ...]
    drawing_mm: tuple[Float64Array, ...]
    findings: tuple[Finding, ...] = ()
    measurement: Measurement | None = None
    profile: Profile | None = None
    width_ends: tuple[float, float, float] | None = None

    @property
    def shape(self) -> str:
        """The shape that was fitted, empty if none was."""
        return "" if self.measurement is None else self.measurement.shape

    def with_findings(self, faults: tuple[Finding, ...]) -> ToolResult:
        """Return the result with further findings, also in its fit."""
        fit = self.measurement and self.measurement.with_findings(faults)
        return replace(self, findings=(*faults, *self.findings), measurement=fit)

    @property
    def verdict(self) -> str:
        """``ok``, or ``doubtful`` where there are findings."""
        return "doubtful" if self.findings else "ok"

    @property
    def reason(self) -> str:
        """Why it is doubtful, empty when ok."""
        return join_reasons(self.findings)

    def __getitem__(self, name: str) -> MeasuredValue:
        """Return the figure of that name."""
        for figure in self.figures:
            if figure.name == name:
                return figure
        raise KeyError(name)


class Tool(ABC):
    """Geometry that can be applied to a height map.

    Attributes
    ----------
    name : str
        Name in files and scripts.
    palette : PaletteEntry
        Entry on the palette.
    depth_figures : tuple of str
        Figures that are depths, and so are judged with the limit of heights.
    """

    __slots__ = ()
    name: ClassVar[str]
    palette: ClassVar[PaletteEntry] = PaletteEntry()
    depth_figures: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure.

        Raises
        ------
        InputError
            If there is nothing to measure at this position of the map.
        """

    def section(self, heightmap: HeightMap) -> Profile | None:
        """Return the depth along the section that it reads, None if it reads none.

        Raises
        ------
        InputError
            If the section does not lie on the map.
        """
        return None

    def with_edge(self, radius_mm: float | None, sd_mm: float | None) -> Tool:
        """Return the tool for an object with a stated edge. A tool without edges is unchanged."""
        return self


def geometry_fields(kind: type[Tool]) -> tuple[Field[Any], ...]:
    """Return the fields of a tool that say where it lies on the membrane, in their order.

    Each is a `Point`, an optional one, several, or a `Rectangle`. Clicks and handles follow from
    them.
    """
    declared: tuple[Field[Any], ...] = fields(cast(Any, kind))
    return tuple(field for field in declared if str(field.type) in PLACES)


def tool_result(
    tool: Tool,
    figures: tuple[MeasuredValue, ...],
    drawing: tuple[Float64Array, ...],
    flags: Flags,
    profile: Profile | None = None,
) -> ToolResult:
    """Return a result, doubtful if many of the points that it uses are flagged.

    Parameters
    ----------
    tool, figures, drawing, profile
        As in :class:`ToolResult`.
    flags : (N,) uint8
        Flags of the points that the figures are computed from.
    """
    flagged = (flags & UNKNOWN) != 0
    fraction = float(np.mean(flagged)) if flagged.size else 0.0
    findings: tuple[Finding, ...] = ()
    if fraction > 0.1:
        names = [str(f.name).lower() for f in Flag if int(f) & UNKNOWN and np.any(flags & int(f))]
        text = f"{100.0 * fraction:.0f} % of the points are flagged ({', '.join(names)})"
        findings = (doubtful_finding("flagged", text),)
    return ToolResult(tool, figures, drawing, findings, profile=profile)
