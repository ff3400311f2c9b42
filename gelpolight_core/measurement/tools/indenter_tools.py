"""The fitted indenters as measuring tools: ball, cylinder and cuboid."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.reconstruction.height_map import HeightMap

from .tool_base import PaletteEntry, Point, Tool, ToolResult


@dataclass(frozen=True, slots=True)
class IndenterTool(Tool):
    """An indenter, fitted with the drape around it.

    Attributes
    ----------
    at_mm : (float, float) or None
        A point on it; None where nothing else is pressed.
    edge_radius_mm, edge_radius_sd_mm : float or None
        Stated fillet of its edge and its standard uncertainty; None: fitted. A ball has none.
    """

    depth_figures = ("height",)
    at_mm: Point | None = None
    edge_radius_mm: float | None = None
    edge_radius_sd_mm: float | None = None

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        fit = measure_heightmap(
            heightmap,
            shape=self.name,
            seed_mm=self.at_mm,
            edge_radius_mm=self.edge_radius_mm,
            edge_radius_sd_mm=self.edge_radius_sd_mm,
        )
        return ToolResult(self, fit.figures, (fit.outline_mm,), fit.findings, measurement=fit)

    def with_edge(self, radius_mm: float | None, sd_mm: float | None) -> Tool:
        """Return it with a stated edge."""
        return replace(self, edge_radius_mm=radius_mm, edge_radius_sd_mm=sd_mm)


class BallTool(IndenterTool):
    """Size and depth of a ball. Attributes as for :class:`IndenterTool`."""

    name = "ball"
    palette = PaletteEntry(section="objects", order=10, tip="Diameter, depth", key="B")


class CylinderTool(IndenterTool):
    """Size and height of a flat cylinder. Attributes as for :class:`IndenterTool`."""

    name = "cylinder"
    palette = PaletteEntry(section="objects", order=20, tip="Diameter, height", key="Y")


class CuboidTool(IndenterTool):
    """Sides, height and yaw of a flat cuboid. Attributes as for :class:`IndenterTool`."""

    name = "cuboid"
    palette = PaletteEntry(section="objects", order=30, tip="Sides, height, rotation", key="U")
