"""A rectangle on the membrane, and the nodes of a height map inside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array, PointXY
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

LEAST_NODES = 9
"""With fewer nodes, a plane cannot be fitted."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle in the sensor frame.

    Attributes
    ----------
    centre_mm : (float, float)
        (x, y).
    sides_mm : (float, float)
        The first lies along `yaw_deg`.
    yaw_deg : float
        From the x axis towards y.

    Raises
    ------
    InputError
        If a number is not finite, or a side is not greater than zero.
    """

    centre_mm: PointXY
    sides_mm: PointXY
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        numbers = (*self.centre_mm, *self.sides_mm, self.yaw_deg)
        if not all(map(math.isfinite, numbers)) or min(self.sides_mm) <= 0.0:
            text = (
                f"the rectangle of {self.sides_mm[0]:g} x {self.sides_mm[1]:g} mm at "
                f"({self.centre_mm[0]:g}, {self.centre_mm[1]:g}) mm has no area"
            )
            raise InputError(text, "rectangle", Remedy.CORRECT_VALUE)

    @property
    def outline_mm(self) -> Float64Array:
        """(5, 2) corners, (x, y), closed."""
        a, b = 0.5 * self.sides_mm[0], 0.5 * self.sides_mm[1]
        along, across = np.array([[-a, a, a, -a, -a], [-b, -b, b, b, -b]])
        return self.place(along, across)

    def place(self, along_mm: Float64Array, across_mm: Float64Array) -> Float64Array:
        """Return sensor coordinates (..., 2) of points along and across the first side.

        Parameters
        ----------
        along_mm, across_mm : (...)
            From the rectangle's centre.
        """
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        x = self.centre_mm[0] + cos * along_mm - sin * across_mm
        y = self.centre_mm[1] + sin * along_mm + cos * across_mm
        return np.stack([x, y], axis=-1)

    def from_centre(
        self, x_mm: Float64Array, y_mm: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """Return how far points (...) lie from the centre, along and across the first side."""
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        dx, dy = x_mm - self.centre_mm[0], y_mm - self.centre_mm[1]
        return cos * dx + sin * dy, cos * dy - sin * dx

    def too_few(self, nodes: int) -> InputError:
        """Return the error for a rectangle with too few nodes of a map."""
        return InputError(
            f"the rectangle contains {nodes} points of the map",
            f"rectangle at ({self.centre_mm[0]:g}, {self.centre_mm[1]:g}) mm",
            Remedy.LARGER_AREA,
        )


@dataclass(frozen=True, slots=True)
class AreaNodes:
    """The nodes of a height map inside an area, without those outside the working area.

    Attributes
    ----------
    x_mm, y_mm, depth_mm : (N,)
        Place and depth.
    flags : (N,) uint8
        Their flags.
    """

    x_mm: Float64Array
    y_mm: Float64Array
    depth_mm: Float64Array
    flags: NDArray[np.uint8]

    def thinned(self, most: int) -> AreaNodes:
        """Return at most this number of nodes, evenly selected."""
        stride = max(math.ceil(self.x_mm.size / most), 1)
        # With a stride that divides the length of the rows, only some columns would be selected.
        selection = np.random.default_rng(0).permutation(self.x_mm.size)[::stride]
        return AreaNodes(
            self.x_mm[selection],
            self.y_mm[selection],
            self.depth_mm[selection],
            self.flags[selection],
        )


def nodes_inside(heightmap: HeightMap, rectangle: Rectangle) -> AreaNodes:
    """Return the nodes inside a rectangle.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    rectangle : Rectangle
        In the sensor frame.

    Raises
    ------
    InputError
        If fewer than nine of them lie in the working area.
    """
    corners = rectangle.outline_mm
    # Nodes on the edge belong to the rectangle, in spite of rounding errors.
    slack = 1e-6 * heightmap.pitch_mm
    low, high = corners.min(axis=0) - slack, corners.max(axis=0) + slack
    columns = np.flatnonzero((heightmap.x_mm >= low[0]) & (heightmap.x_mm <= high[0]))
    rows = np.flatnonzero((heightmap.y_mm >= low[1]) & (heightmap.y_mm <= high[1]))
    x, y = np.meshgrid(heightmap.x_mm[columns], heightmap.y_mm[rows])
    along, across = rectangle.from_centre(x, y)
    depth = heightmap.depth_mm[np.ix_(rows, columns)].astype(np.float64)
    flags = heightmap.flags[np.ix_(rows, columns)]
    inside = (np.abs(along) <= 0.5 * rectangle.sides_mm[0] + slack) & (
        np.abs(across) <= 0.5 * rectangle.sides_mm[1] + slack
    )
    inside &= ((flags & int(Flag.OUTSIDE)) == 0) & np.isfinite(depth)
    if int(inside.sum()) < LEAST_NODES:
        raise rectangle.too_few(int(inside.sum()))
    return AreaNodes(x[inside], y[inside], depth[inside], flags[inside])
