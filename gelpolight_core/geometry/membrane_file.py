"""Read the undeformed membrane from a file, once, as heights on a grid.

A cubic spline follows the vertices as smoothly as they allow (P-splines: Eilers and Marx,
Statistical Science 11, 1996). On a dome 2 mm high over 26 mm, vertices 2 mm apart give heights
within 2 um and slopes within 0.002, vertices 1 mm apart 0.05 um and 0.0001. Nothing else of the
file is used afterwards.
"""

from __future__ import annotations

import zipfile
from math import comb
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy

from .membrane_shape import HEIGHT_FIELD, MembraneShape

FIELD_KEYS, FIELD_NODES = ("x_mm", "y_mm", "height_mm"), 65
"""Arrays of a file with a height field, and nodes to a side of one in a calibration."""
GRID_NODES = 8 * FIELD_NODES
"""Nodes to a side from which on a finer grid in a file adds nothing."""
MARGIN = 6
"""Steps of the grid around the boundary in which vertices are used: those of 2 mm wide faces."""
FACING = 0.1
"""Least share along the axis of the normal of a face of the membrane in a mesh."""
LEVEL_MM = 0.1
"""How far the boundary may be from height 0, and the membrane on the camera's side of it."""
WIDEST = 10.0
"""Most width of a file in diameters of the boundary: the housing, but no unit below the mm."""
UNITS_MM = {"micrometres": 1e-3, "centimetres": 10.0, "inches": 25.4, "metres": 1e3}
"""Units that are confused with mm. The width in diameters, 1 to 2.5, shows which one."""
SMOOTHNESS, FACETS = 1e-3, 1e-6
"""Weights of a third difference between nodes and of a place on a facet, against a vertex. The
first smooths what is shorter than two steps of the grid. By their ratio, gaps between vertices are
smooth up to ten steps, half a wavelength of 2 pi (1e-3 / 1e-6)^(1/6), and wider ones as flat as the
facets."""


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
        If the file is missing, holds something else, or does not fit the boundary in width,
        height or side.
    """
    path = folder / name
    triangles_mm = (_from_mesh if path.suffix.lower() == ".stl" else _from_grid)(path)
    try:
        heights_mm = _heights_on_the_grid(triangles_mm, 0.5 * diameter_mm)
    except _Misfit as error:
        text = f"{error}. The file is {_size(triangles_mm.reshape(-1, 3), diameter_mm)}"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error
    rows = tuple(tuple(row) for row in heights_mm.tolist())
    apex_mm = rows[FIELD_NODES // 2][FIELD_NODES // 2]
    return MembraneShape(HEIGHT_FIELD, apex_mm, diameter_mm, heights_mm=rows, file=name)


class _Misfit(Exception):
    """How a file does not fit the boundary."""


def _heights_on_the_grid(triangles_mm: Float64Array, rim_mm: float) -> Float64Array:
    """Return the heights (rows, columns) of the outer side at the nodes of the grid."""
    from scipy.spatial import KDTree  # slow to import

    boundary = f"the boundary, {2.0 * rim_mm:g} mm wide"
    if np.ptp(triangles_mm[..., :2], axis=(0, 1)).max() > 2.0 * WIDEST * rim_mm:
        raise _Misfit(f"The file is much wider than {boundary}")
    axis_mm, step_mm = np.linspace(-rim_mm, rim_mm, FIELD_NODES, retstep=True)
    nodes_mm = np.stack(np.meshgrid(axis_mm, axis_mm), axis=-1)
    outer_mm = _outer_side(triangles_mm, rim_mm)
    facets_mm = _places_on(outer_mm, rim_mm, 0.5 * step_mm)
    facets_mm = _thinned(facets_mm[_radius(facets_mm) <= rim_mm], 0.5 * step_mm)
    covered_mm = nodes_mm[_radius(nodes_mm) < rim_mm - step_mm]
    if not len(facets_mm) or KDTree(facets_mm[:, :2]).query(covered_mm)[0].max() > step_mm:
        raise _Misfit(f"The file does not cover {boundary}")
    # With those outside of which a face reaches in. A flange begins with faces of its own.
    fine_mm = 0.25 * step_mm
    vertices_mm = outer_mm[_radius(outer_mm).min(axis=1) < rim_mm - fine_mm].reshape(-1, 3)
    grid_mask = np.abs(vertices_mm[:, :2]).max(axis=1) < rim_mm + MARGIN * step_mm
    coefficients = _fitted(_thinned(vertices_mm[grid_mask], fine_mm), facets_mm, rim_mm)
    angles_rad = np.linspace(0.0, 2.0 * np.pi, 4 * FIELD_NODES)
    circle_mm = rim_mm * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1)
    edge_mm = _splines(circle_mm, rim_mm) @ coefficients
    if np.abs(edge_mm).max() > LEVEL_MM:
        span = f"{edge_mm.min():.2f} to {edge_mm.max():.2f} mm"
        raise _Misfit(f"Height 0 is not at {boundary}, which is {span} high in the file")
    heights_mm = _splines(nodes_mm.reshape(-1, 2), rim_mm) @ coefficients
    inside_mm = heights_mm[_radius(nodes_mm).ravel() <= rim_mm]
    if inside_mm.min() < -LEVEL_MM:
        under = f"{-inside_mm.min():.2f} mm under its boundary, on the camera's side"
        raise _Misfit(f"The membrane is up to {under}, as if it were upside down")
    if inside_mm.max() > rim_mm:
        raise _Misfit(f"The membrane is up to {inside_mm.max():.5g} mm high over {boundary}")
    min_mm = triangles_mm[_radius(triangles_mm) <= rim_mm, 2].min(initial=0.0)
    if inside_mm.max() < LEVEL_MM and min_mm < -2.0 * LEVEL_MM:
        raise _Misfit("The outer side of the body is flat, as if it were upside down")
    return np.asarray(heights_mm.reshape(FIELD_NODES, FIELD_NODES))


def _size(points_mm: Float64Array, diameter_mm: float) -> str:
    """Return size and middle of a file, with the unit that it seems to have."""
    size = np.ptp(points_mm, axis=0)
    middle = np.round(points_mm.min(axis=0) + 0.5 * size, 3) + 0.0
    text = " x ".join(f"{length:.5g}" for length in size)
    text += f" mm about ({', '.join(f'{length:g}' for length in middle)})"
    for unit, in_mm in UNITS_MM.items():
        if 1.0 <= size[:2].min() * in_mm / diameter_mm < 2.5:
            return f"{text}. Its numbers seem to be {unit}: give them in mm"
    return text


def _from_grid(path: Path) -> Float64Array:
    """Return the triangles (N, 3, 3) between the nodes of an npz file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            x, y, height = (np.asarray(file[key], np.float64) for key in FIELD_KEYS)
        points = np.stack([*np.meshgrid(x, y), height], axis=-1)
        points = points[:: len(y) // GRID_NODES + 1, :: len(x) // GRID_NODES + 1]
        a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
        triangles = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3, 3)
        triangles = triangles[np.isfinite(triangles).all(axis=(1, 2))]
        if min(np.diff(x).min(), np.diff(y).min()) <= 0.0 or not len(triangles):
            raise ValueError
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile) as error:
        text = "The file does not hold x_mm, y_mm and height_mm of a grid"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error
    return np.asarray(triangles)


def _from_mesh(path: Path) -> Float64Array:
    """Return the triangles (N, 3, 3) of an STL file."""
    from trimesh import load_mesh  # slow to import

    try:
        with path.open("rb") as file:
            triangles = np.asarray(load_mesh(file, file_type="stl", process=False).triangles)
        if not len(triangles) or not np.isfinite(triangles).all():
            raise ValueError
    except (OSError, ValueError, IndexError) as error:
        text = "The file does not hold a mesh of the membrane in STL"
        raise InputError(text, path, Remedy.CORRECT_FILE) from error
    return triangles


def _outer_side(triangles_mm: Float64Array, rim_mm: float) -> Float64Array:
    """Return the triangles over the boundary that objects touch, the upper ones of a body."""
    triangles_mm = _over_the_boundary(triangles_mm, rim_mm)
    a, b, c = np.moveaxis(triangles_mm, 1, 0)
    normals = np.cross(b - a, c - a)
    upwards, share = normals[:, 2], FACING * np.linalg.norm(normals, axis=-1)
    # A sheet has one of the two, and in a body that is inside out they change places.
    sides = [triangles_mm[side] for side in (upwards > share, upwards < -share)]
    return max(sides, key=lambda side: side[..., 2].mean() if len(side) else -np.inf)


def _over_the_boundary(triangles_mm: Float64Array, rim_mm: float) -> Float64Array:
    """Return the triangles that reach into the square about the boundary."""
    places = triangles_mm[..., :2]
    near_mask = (places.min(axis=1) < rim_mm) & (places.max(axis=1) > -rim_mm)
    return np.asarray(triangles_mm[near_mask.all(axis=1)])


def _places_on(triangles_mm: Float64Array, rim_mm: float, edge_mm: float) -> Float64Array:
    """Return the corners (N, 3) of triangles, halved until no edge is longer than the given one."""
    places_mm = []
    while len(triangles_mm := _over_the_boundary(triangles_mm, rim_mm)):
        edges_mm = np.linalg.norm(triangles_mm - np.roll(triangles_mm, -1, axis=1), axis=-1)
        long_mask = edges_mm.max(axis=1) > edge_mm
        places_mm.append(triangles_mm[~long_mask].reshape(-1, 3))
        order = (edges_mm.argmax(axis=1)[long_mask, None] + np.arange(3)) % 3
        longest_first = np.take_along_axis(triangles_mm[long_mask], order[..., None], axis=1)
        a, b, c = np.moveaxis(longest_first, 1, 0)
        middle = 0.5 * (a + b)
        triangles_mm = np.stack([a, middle, c, middle, b, c], axis=1).reshape(-1, 3, 3)
    return np.concatenate([np.empty((0, 3)), *places_mm])


def _radius(points_mm: Float64Array) -> Float64Array:
    """Return the distance (...) from the axis of points (..., 2 or 3)."""
    return np.asarray(np.hypot(points_mm[..., 0], points_mm[..., 1]))


def _thinned(points_mm: Float64Array, cell_mm: float) -> Float64Array:
    """Return the first of the points (N, 3) in each cell."""
    cells = np.floor(points_mm[:, :2] / cell_mm).astype(np.int64)
    column, row = (cells - cells.min(axis=0, initial=0)).T
    _, first = np.unique(column * (row.max(initial=0) + 1) + row, return_index=True)
    return points_mm[first]


def _splines(points_mm: Float64Array, rim_mm: float) -> Any:
    """Return the values (N, M) of all B-splines of the grid at points (N, 2), sparse."""
    from scipy.interpolate import BSpline  # slow to import
    from scipy.sparse import csr_array

    places = (points_mm / rim_mm + 1.0) * (0.5 * (FIELD_NODES - 1))
    knots = np.arange(-3.0 - MARGIN, FIELD_NODES + MARGIN + 3.0)
    x, y = (BSpline.design_matrix(place, knots, 3) for place in places.T)
    count, columns = len(points_mm), x.shape[1]
    values = y.data.reshape(-1, 4, 1) * x.data.reshape(-1, 1, 4)
    index = y.indices.reshape(-1, 4, 1) * columns + x.indices.reshape(-1, 1, 4)
    starts = np.arange(0, 16 * count + 1, 16)
    return csr_array((values.ravel(), index.ravel(), starts), shape=(count, columns**2))


def _fitted(vertices_mm: Float64Array, facets_mm: Float64Array, rim_mm: float) -> Float64Array:
    """Return the coefficients (M,) of the smooth spline that follows vertices and facets."""
    from scipy.sparse import kron  # slow to import
    from scipy.sparse.linalg import splu

    side = FIELD_NODES + 2 * MARGIN + 2
    differences = [np.diff(np.eye(side), k, axis=0) for k in range(4)]
    squares = [d.T @ d for d in differences]
    matrix = sum(
        SMOOTHNESS * comb(3, k) * kron(squares[k], squares[3 - k], format="csr") for k in range(4)
    )
    right = np.zeros(side**2)
    for points_mm, weight in ((vertices_mm, 1.0), (facets_mm, FACETS)):
        splines = _splines(points_mm[:, :2], rim_mm)
        matrix = matrix + weight * (splines.T @ splines)
        right += weight * (splines.T @ points_mm[:, 2])
    # Of a symmetric matrix, twice as fast as with the defaults.
    symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0}
    factors = splu(matrix.tocsc(), **symmetric, options={"SymmetricMode": True})
    return np.asarray(factors.solve(right))
