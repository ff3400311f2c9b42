"""Prepare a height map for evaluation: level it, and subtract an earlier one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, PointXY
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.fits import above_plane
from gelpolight_core.geometry.membrane_shape import FLAT
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

from .measured_value import depth_at

FAR = 3.0
"""Standard deviations."""


def level_by_plane(heightmap: HeightMap, *, mask: BoolArray | None = None) -> HeightMap:
    """Subtract the least-squares plane of the untouched surface from a height map.

    Parameters
    ----------
    heightmap : HeightMap
        The surface.
    mask : (rows, columns) bool, optional
        Where the plane is fitted. Default: everywhere with a depth; what lies more than three
        standard deviations from the plane, such as a pressed object, is left out in three rounds.

    Raises
    ------
    InputError
        If fewer than three points can be used.
    """
    inlier_mask = heightmap.known if mask is None else heightmap.known & mask
    x, y = np.meshgrid(heightmap.x_mm, heightmap.y_mm)
    depth = heightmap.depth_mm.astype(np.float64)
    residual_mm = depth
    # Rounds of levelling without the object: each excludes points far from the previous plane.
    for _ in range(3 if mask is None else 1):
        if inlier_mask.sum() < 3:
            raise InputError(
                "fewer than three points have a depth", "levelling", Remedy.LARGER_AREA
            )
        residual_mm = above_plane(x, y, depth, inlier_mask)
        median_mm = float(np.median(residual_mm[inlier_mask]))
        robust_sd_mm = robust_sd(residual_mm[inlier_mask] - median_mm)
        inlier_mask &= np.abs(residual_mm - median_mm) <= max(FAR * robust_sd_mm, 1e-9)
    return _without(heightmap, depth - residual_mm, "Levelled by a least-squares plane.")


def level_by_points(heightmap: HeightMap, points_mm: Sequence[PointXY]) -> HeightMap:
    """Subtract the plane through three points of the surface from a height map.

    Parameters
    ----------
    heightmap : HeightMap
        The surface.
    points_mm : three (x, y)
        Places in the sensor frame. They read 0 afterwards.

    Raises
    ------
    InputError
        If there are not three points with a depth, or they lie on a line.
    """
    positions = np.asarray(points_mm, np.float64)
    if positions.shape != (3, 2):
        text = f"there are {len(positions)} points for a plane, which needs three"
        raise InputError(text, "levelling", Remedy.PLACE_POINTS)
    depth = depth_at(heightmap, positions[:, 0], positions[:, 1])
    (ax, ay), (bx, by) = positions[1] - positions[0], positions[2] - positions[0]
    longest = max(ax**2 + ay**2, bx**2 + by**2, 1e-12)
    # Least area of the triangle of three points, relative to its longest side squared; below it,
    # the points lie on a line.
    if not np.isfinite(depth).all() or abs(ax * by - ay * bx) < 1e-3 * longest:
        text = "the three points lie on a line, or one has no depth"
        raise InputError(text, "levelling", Remedy.PLACE_POINTS)
    terms = np.column_stack([np.ones(3), positions])
    level, slope_x, slope_y = np.linalg.solve(terms, depth)
    x, y = np.meshgrid(heightmap.x_mm, heightmap.y_mm)
    plane = level + slope_x * x + slope_y * y
    # The errors of the three depths tilt the whole map; they are not propagated.
    return replace(
        _without(heightmap, plane, "Levelled by three points."),
        slope_sd=None,
        depth_sd_mm=None,
        slope_model_sd=None,
        depth_model_sd_mm=None,
        noise_mm=None,
    )


def depth_below_boundary_plane(heightmap: HeightMap) -> HeightMap:
    """Return the surface of a curved membrane as a depth below the plane of its boundary.

    Parameters
    ----------
    heightmap : HeightMap
        With depths from the undeformed membrane; a flat one stays as it is.
    """
    if heightmap.at_rest.flat:
        return heightmap
    note = "The surface itself: depths from the plane of the membrane's boundary."
    return _processed(heightmap, note, depth_mm=-heightmap.height_mm, at_rest=FLAT)


def subtract_map(heightmap: HeightMap, earlier: HeightMap) -> HeightMap:
    """Return how much deeper a height map is than an earlier one of the same sensor.

    The earlier map is read at the points of the first, linear between its own. Points without an
    earlier depth are flagged as outside. The errors of both maps count as independent.

    Parameters
    ----------
    heightmap, earlier : HeightMap
        In the same sensor frame; their grids may differ.

    Raises
    ------
    InputError
        If the two do not overlap.
    """
    outside = (earlier.flags & np.uint8(Flag.OUTSIDE)) != 0
    other = _on_grid(heightmap, earlier, np.where(outside, np.nan, earlier.depth_mm))
    valid_mask = np.isfinite(other)
    if not (valid_mask & heightmap.known).any():
        text = "the two height maps do not overlap"
        raise InputError(text, f"{heightmap.source}, {earlier.source}", Remedy.SAME_SENSOR)
    note = f"Difference to {earlier.source}."
    subtracted = _without(heightmap, np.where(valid_mask, other, heightmap.depth_mm), note)
    flags = subtracted.flags | np.where(valid_mask, 0, np.uint8(Flag.OUTSIDE)).astype(np.uint8)
    spreads = {
        name: _root_sum_square(heightmap, earlier, name)
        for name in ("depth_sd_mm", "depth_model_sd_mm")
    }
    return replace(subtracted, flags=flags, noise_mm=None, **spreads)


def _on_grid(
    heightmap: HeightMap, other: HeightMap, values: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Return values of another map at the points of this one, NaN beyond it."""
    axes = (heightmap.x_mm, other.x_mm), (heightmap.y_mm, other.y_mm)
    if all(axis.size == its.size and np.allclose(axis, its, atol=1e-6) for axis, its in axes):
        return np.asarray(values, np.float32)
    column, row = (
        ((axis - float(its[0])) / other.pitch_mm).astype(np.float32) for axis, its in axes
    )
    columns, rows = np.meshgrid(column, row)
    linear, edge, beyond = cv2.INTER_LINEAR, cv2.BORDER_CONSTANT, float("nan")
    given = values.astype(np.float32)
    resampled = cv2.remap(given, columns, rows, linear, borderMode=edge, borderValue=beyond)
    return np.asarray(resampled, np.float32)


def _root_sum_square(heightmap: HeightMap, earlier: HeightMap, name: str) -> Any:
    """Return the standard deviation of a difference, None where one of the two is missing."""
    first, second = getattr(heightmap, name), getattr(earlier, name)
    if first is None or second is None:
        return None
    return np.asarray(np.hypot(first, _on_grid(heightmap, earlier, second)), np.float32)


def _processed(heightmap: HeightMap, note: str, **changes: Any) -> HeightMap:
    findings = (*heightmap.findings, Finding("processed", note))
    return replace(heightmap, findings=findings, **changes)


def _without(heightmap: HeightMap, plane: NDArray[np.floating], note: str) -> HeightMap:
    depth = (heightmap.depth_mm - plane).astype(np.float32)
    return _processed(heightmap, note, depth_mm=depth, normals=None)
