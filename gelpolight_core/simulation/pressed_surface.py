"""The surface of a pressed membrane: a depth map with tiles to skip empty space."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from gelpolight_core.base.arrays import BoolArray, Float64Array

from .design_parts import MembraneDesign

TILE = 16
"""Side of a tile in cells; only the extremes of each tile are used while skipping."""


@dataclass(frozen=True, slots=True)
class PressedSurface:
    """Depth of the membrane on a regular grid, zero outside it.

    Attributes
    ----------
    depth_mm : (rows, columns)
        Indentation towards the camera.
    contact : (rows, columns) bool
        Contact with the indenter.
    x0_mm, y0_mm : float
        Position of the first cell's centre, sensor frame.
    pitch_mm : float
        Distance between cells.
    rest_mm : (rows, columns) or float, optional
        Depth of the membrane at rest, see :meth:`on`.
    """

    depth_mm: Float64Array
    contact: BoolArray
    x0_mm: float
    y0_mm: float
    pitch_mm: float
    rest_mm: Float64Array | float = 0.0
    slope_x: Float64Array = field(init=False, repr=False)
    slope_y: Float64Array = field(init=False, repr=False)
    tile_max: Float64Array = field(init=False, repr=False)
    tile_min: Float64Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Compute slopes and tiles."""
        depth = np.ascontiguousarray(self.depth_mm, dtype=np.float64)
        slope_y, slope_x = np.gradient(depth, self.pitch_mm)
        high, low = _tiles(depth)
        values = {
            "depth_mm": depth,
            "slope_x": np.ascontiguousarray(slope_x),
            "slope_y": np.ascontiguousarray(slope_y),
            "tile_max": high,
            "tile_min": low,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def x_mm(self) -> Float64Array:
        """(columns,) positions of the cells."""
        return self.x0_mm + self.pitch_mm * np.arange(self.depth_mm.shape[1], dtype=np.float64)

    @property
    def y_mm(self) -> Float64Array:
        """(rows,) positions of the cells."""
        return self.y0_mm + self.pitch_mm * np.arange(self.depth_mm.shape[0], dtype=np.float64)

    def on(self, membrane: MembraneDesign) -> PressedSurface:
        """Return the whole surface of a membrane that is pressed in like this one.

        Its places are seen from the membrane's axis, and its depth is measured from the plane of
        the apex, so that it is nowhere negative. A flat membrane is zero outside the grid already.
        """
        moved = replace(
            self, x0_mm=self.x0_mm - membrane.axis_mm[0], y0_mm=self.y0_mm - membrane.axis_mm[1]
        )
        if membrane.apex_height_mm == 0.0:
            return moved
        # Level only beyond the cells that the slope at the boundary is read from.
        end = 0.5 * membrane.working_diameter_mm + 3.0 * moved.pitch_mm
        ends = ((moved.y_mm[0], moved.y_mm[-1]), (moved.x_mm[0], moved.x_mm[-1]))
        room = [
            [max(0, math.ceil(gap / moved.pitch_mm)) for gap in (end + first, end - last)]
            for first, last in ends
        ]
        y0, x0 = (first - r[0] * moved.pitch_mm for (first, _), r in zip(ends, room, strict=True))
        depth, contact = np.pad(moved.depth_mm, room), np.pad(moved.contact, room)
        y, x = (
            start + moved.pitch_mm * np.arange(n)
            for start, n in zip((y0, x0), depth.shape, strict=True)
        )
        radius = np.minimum(np.hypot(x[None], y[:, None]), end)
        rest = membrane.apex_height_mm - membrane.height_mm(radius)
        return PressedSurface(depth + rest, contact, x0, y0, moved.pitch_mm, rest)


def _tiles(depth_mm: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return the highest and lowest depth of each tile and of its neighbouring cells."""
    high = maximum_filter(depth_mm, size=3, mode="nearest")
    low = minimum_filter(depth_mm, size=3, mode="nearest")
    rows, columns = (-(-n // TILE) for n in depth_mm.shape)
    room = ((0, rows * TILE - depth_mm.shape[0]), (0, columns * TILE - depth_mm.shape[1]))
    high = np.pad(high, room, mode="edge").reshape(rows, TILE, columns, TILE)
    low = np.pad(low, room, mode="edge").reshape(rows, TILE, columns, TILE)
    return (
        np.ascontiguousarray(high.max(axis=(1, 3))),
        np.ascontiguousarray(low.min(axis=(1, 3))),
    )
