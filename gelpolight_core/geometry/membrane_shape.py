"""The undeformed membrane: its height over the plane of its boundary.

A flat membrane lies in that plane. A new shape is a function here and an entry of `SHAPES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gelpolight_core.base.arrays import Float64Array

HEIGHT_FIELD, LEAST_NODES = "height_field", 5
"""The shape with heights of its own, and the fewest to a side that a cubic spline follows."""
STEP_MM = 1e-3
"""Distance between the heights whose difference is a slope."""
STEPS, MET_MM = 60, 1e-10
"""Most steps to a place on the membrane, and the move at which they end."""
STEEPEST = 0.99
"""Share of a sphere's radius up to which it is a height over the plane."""


class HeightRows(tuple[tuple[float, ...], ...]):
    """Rows of a height field, with the spline through them for all shapes that share them."""

    @classmethod
    def of(cls, rows: tuple[tuple[float, ...], ...]) -> HeightRows:
        """Return the rows themselves, or their copy that keeps the spline."""
        return rows if isinstance(rows, cls) else cls(rows)

    @cached_property
    def coefficients(self) -> Float64Array:
        """Coefficients of the spline."""
        from .height_spline import spline_coefficients  # slow to import

        return spline_coefficients(np.array(self))


@dataclass(frozen=True, slots=True)
class MembraneShape:
    """A membrane at rest, as a height towards z (away from the camera) in the sensor frame.

    Attributes
    ----------
    shape : str
        One of `SHAPES`.
    apex_height_mm : float
        Height on the axis over the plane of the boundary.
    diameter_mm : float
        Diameter of the boundary.
    axis_mm : (x, y)
        Where the axis meets the plane.
    rise_mm : float
        What is added on the axis, and falls as a paraboloid to 0 at the boundary: how far a mould
        is off.
    heights_mm : tuple of rows
        Heights of a height field: a square about the axis as wide as the boundary.
    file : str
        File of a height field beside session.toml.
    """

    shape: str = "plane"
    apex_height_mm: float = 0.0
    diameter_mm: float = 0.0
    axis_mm: tuple[float, float] = (0.0, 0.0)
    rise_mm: float = 0.0
    heights_mm: tuple[tuple[float, ...], ...] = ()
    file: str = ""

    def __post_init__(self) -> None:
        """Keep the spline with the rows, also in copies with another axis or rise."""
        object.__setattr__(self, "heights_mm", HeightRows.of(self.heights_mm))

    @property
    def flat(self) -> bool:
        """Whether it is the plane itself."""
        return self.shape == "plane" and self.rise_mm == 0.0

    def check(self) -> None:
        """Refuse impossible values.

        Raises
        ------
        ValueError
            With the first of them.
        """
        if self.shape not in SHAPES or (not self.flat and self.diameter_mm <= 0.0):
            raise ValueError("the shape of the membrane is unknown")
        if not abs(self.apex_height_mm + self.rise_mm) <= 0.5 * self.diameter_mm:
            raise ValueError("the membrane is higher than half its diameter")
        nodes = len(self.heights_mm)
        square = nodes >= LEAST_NODES and all(len(row) == nodes for row in self.heights_mm)
        if self.shape == HEIGHT_FIELD and not square:
            raise ValueError("the heights of the membrane are not a square")

    def in_units(self, unit_mm: float, origin_mm: tuple[float, float]) -> MembraneShape:
        """Return the surface with all lengths in another unit, seen from another origin."""
        x, y = ((a - b) / unit_mm for a, b in zip(self.axis_mm, origin_mm, strict=True))
        return replace(
            self,
            apex_height_mm=self.apex_height_mm / unit_mm,
            diameter_mm=self.diameter_mm / unit_mm,
            axis_mm=(x, y),
            rise_mm=self.rise_mm / unit_mm,
            heights_mm=tuple(tuple(h / unit_mm for h in row) for row in self.heights_mm),
        )

    def height(self, points_mm: Float64Array) -> Float64Array:
        """Return the height (...) in mm at points (..., 2) in mm."""
        offset_mm = np.asarray(points_mm, np.float64) - self.axis_mm
        x, y = offset_mm[..., 0], offset_mm[..., 1]
        height = SHAPES[self.shape](self, x, y)
        if self.rise_mm:
            height = height + self.rise_mm * (1.0 - (x**2 + y**2) / (0.5 * self.diameter_mm) ** 2)
        return np.asarray(height)

    def slopes(self, points_mm: Float64Array) -> Float64Array:
        """Return the slopes (..., 2) of the height along x and y."""
        points = np.asarray(points_mm, np.float64)
        if self.flat:
            return np.zeros_like(points)
        steps = STEP_MM * np.eye(2)
        rises = [self.height(points + step) - self.height(points - step) for step in steps]
        return np.asarray(np.stack(rises, axis=-1) / (2.0 * STEP_MM))

    def points(self, points_mm: Float64Array) -> Float64Array:
        """Return the places (..., 3) of the membrane over points (..., 2)."""
        return np.concatenate([points_mm, self.height(points_mm)[..., None]], axis=-1)

    def met_by(self, foot_mm: Float64Array, ray_slope: Float64Array) -> Float64Array:
        """Return where rays meet it, (..., 2).

        Parameters
        ----------
        foot_mm : (..., 2)
            Where they meet the plane of the boundary.
        ray_slope : (..., 2)
            How much they move sideways per mm towards the camera.
        """
        if self.flat:
            return foot_mm
        # Each step shrinks the error by the product of the two slopes.
        return _settled(lambda p: foot_mm - self.height(p)[..., None] * ray_slope, foot_mm)

    def nearest(self, point_mm: Float64Array) -> Float64Array:
        """Return the place (2,) where it is nearest to a point (3,)."""

        def along_the_tangent_plane(place: Float64Array) -> Float64Array:
            offset, normal = point_mm - self.points(place), self.normals(place)
            return np.asarray(place + (offset - (offset @ normal) * normal)[:2])

        # Each step shrinks the error by the distance times the curvature.
        return _settled(along_the_tangent_plane, point_mm[:2])

    def normals(self, points_mm: Float64Array) -> Float64Array:
        """Return the unit normals (..., 3) towards the camera at points (..., 2)."""
        slopes = self.slopes(points_mm)
        normals = np.concatenate([slopes, -np.ones_like(slopes[..., :1])], axis=-1)
        return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def _settled(step: Callable[[Float64Array], Float64Array], points_mm: Float64Array) -> Float64Array:
    """Repeat a step from points (..., 2) until they stay where they are."""
    for _ in range(STEPS):
        before, points_mm = points_mm, step(points_mm)
        if not np.any(np.abs(points_mm - before) > MET_MM):
            break
    return points_mm


def _plane(_surface: MembraneShape, x: Float64Array, _y: Float64Array) -> Float64Array:
    return np.zeros_like(x)


def _spherical_cap(surface: MembraneShape, x: Float64Array, y: Float64Array) -> Float64Array:
    if surface.apex_height_mm == 0.0:
        return np.zeros_like(x)
    rim = 0.5 * surface.diameter_mm
    radius = (rim**2 + surface.apex_height_mm**2) / (2.0 * surface.apex_height_mm)
    square = np.minimum(x**2 + y**2, (STEEPEST * radius) ** 2)
    # The difference of two large numbers, written without one.
    return np.asarray(surface.apex_height_mm - square / (radius + np.sqrt(radius**2 - square)))


def _height_field(surface: MembraneShape, x: Float64Array, y: Float64Array) -> Float64Array:
    from .height_spline import spline_heights  # slow to import

    rows = HeightRows.of(surface.heights_mm)
    heights = spline_heights(rows.coefficients, surface.diameter_mm, x.ravel(), y.ravel())
    return np.asarray(heights.reshape(x.shape))


SHAPES: dict[str, Callable[[MembraneShape, Float64Array, Float64Array], Float64Array]] = {
    "plane": _plane,
    "spherical_cap": _spherical_cap,
    HEIGHT_FIELD: _height_field,
}
"""The height in mm of each shape at x and y from its axis."""
FLAT = MembraneShape()
