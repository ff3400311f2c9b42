"""The undeformed membrane: its height over the plane of its boundary.

A flat membrane lies in that plane. A new shape is a function here and an entry of `SHAPES`.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy

HEIGHT_FIELD = "height_field"
FIELD_KEYS, FIELD_NODES = ("x_mm", "y_mm", "height_mm"), 65
"""Arrays of a file with a height field, and nodes to a side of one in a calibration."""
STEP_MM = 1e-3
"""Distance between the heights whose difference is a slope."""
FACING = 0.1
"""Least share along the axis of the normal of a face of the membrane in a mesh."""
STEPS, MET_MM = 60, 1e-10
"""Most steps to a place on the membrane, and the move at which they end."""
STEEPEST = 0.99
"""Share of a sphere's radius up to which it is a height over the plane."""


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


def height_field(folder: Path, name: str, diameter_mm: float) -> MembraneShape:
    """Return a height field from a file.

    Parameters
    ----------
    folder : Path
        Where the file is.
    name : str
        Name of the file, with heights (mm) from the plane of the boundary about the axis.
        An STL mesh of the membrane, or an npz file with the arrays x_mm and y_mm, rising, and
        height_mm (rows, columns).
    diameter_mm : float
        Diameter of the boundary.

    Raises
    ------
    InputError
        If the file is missing, holds something else, or does not cover the boundary.
    """
    path, rim = folder / name, 0.5 * diameter_mm
    read = _from_mesh if path.suffix.lower() == ".stl" else _from_grid
    x, y = np.meshgrid(*2 * (np.linspace(-rim, rim, FIELD_NODES),))
    # Towards the corners it goes on as the parabola through three places on the same radius.
    end = rim * (1.0 - 2.0 / (FIELD_NODES - 1))
    share = end / np.maximum(np.hypot(x, y), end)
    field = read(path)
    first, second, third = (field(x * r, y * r) for r in (share, 2 * share - 1, 3 * share - 2))
    heights = 3.0 * (first - second) + third
    if not np.isfinite(heights).all():
        text = f"The file does not cover the boundary, {diameter_mm:g} mm wide"
        raise InputError(text, path, Remedy.CORRECT_FILE)
    rows = tuple(tuple(row) for row in heights.tolist())
    apex_mm = float(heights[FIELD_NODES // 2, FIELD_NODES // 2])
    return MembraneShape(HEIGHT_FIELD, apex_mm, diameter_mm, heights_mm=rows, file=name)


def _from_grid(path: Path) -> Callable[[Float64Array, Float64Array], Float64Array]:
    """Return the height at x and y in an npz file, NaN where it does not cover them."""
    from scipy.interpolate import RegularGridInterpolator  # slow to import

    try:
        with np.load(path, allow_pickle=False) as file:
            x, y, height = (np.asarray(file[key], np.float64) for key in FIELD_KEYS)
        field = RegularGridInterpolator((x, y), height.T, "cubic", bounds_error=False)
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile) as error:
        text = "The file does not hold x_mm, y_mm and height_mm of a grid"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error
    return lambda x, y: np.asarray(field((x, y)))


def _from_mesh(path: Path) -> Callable[[Float64Array, Float64Array], Float64Array]:
    """Return the height at x and y over a mesh, NaN where it does not cover them."""
    from scipy.interpolate import CloughTocher2DInterpolator  # slow to import
    from scipy.spatial import QhullError
    from trimesh import load_mesh

    try:
        with path.open("rb") as file:
            mesh = load_mesh(file, file_type="stl")
        # Of a solid, only the side that the objects touch.
        up = mesh.face_normals[:, 2]
        outer = mesh.triangles[up > FACING if (up > FACING).any() else up < -FACING]
        points = np.unique(outer.reshape(-1, 3), axis=0)
        field = CloughTocher2DInterpolator(points[:, :2], points[:, 2])
    except (OSError, ValueError, IndexError, QhullError) as error:
        text = "The file does not hold a mesh of the membrane in STL"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error
    return lambda x, y: np.asarray(field(x, y))


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
    from scipy.interpolate import RectBivariateSpline  # slow to import

    heights = np.asarray(surface.heights_mm)
    rim = 0.5 * surface.diameter_mm
    rows, columns = (np.linspace(-rim, rim, n) for n in heights.shape)
    return np.asarray(RectBivariateSpline(rows, columns, heights).ev(y, x))


SHAPES: dict[str, Callable[[MembraneShape, Float64Array, Float64Array], Float64Array]] = {
    "plane": _plane,
    "spherical_cap": _spherical_cap,
    HEIGHT_FIELD: _height_field,
}
"""The height in mm of each shape at x and y from its axis."""
FLAT = MembraneShape()
