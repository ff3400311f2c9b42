"""The image of a surface by the full model: direct light, shadows, interreflection, crosstalk.

Nothing of it comes from an image: the light that the membrane reflects onto itself follows from the
light that falls on it.
"""

from __future__ import annotations

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import LEAST_LIGHT
from gelpolight_core.light.membrane_field import view_directions
from gelpolight_core.reconstruction.height_map import (
    COARSE,
    HeightMap,
    normals_from_slopes,
    surface_slopes,
)
from gelpolight_core.reconstruction.solver import stride_slices

from .kernel_structures import GridRegion
from .membrane_interreflection import (
    CLEAR,
    InterreflectionModel,
    SurfaceFacets,
    intersect_depth,
    received,
)
from .sensor_maps import SensorMaps


def surface_image(
    height_map: HeightMap, maps: SensorMaps, around: InterreflectionModel, step: int
) -> Float32Array:
    """Return the brightness (rows, columns, 3) of a surface relative to the flat membrane.

    Parameters
    ----------
    height_map : HeightMap
        Depth at true positions.
    maps : SensorMaps
        Precomputed calibration data.
    around : InterreflectionModel
        Light and shadows of its membrane on itself.
    step : int
        Nodes of the grid to a node of the image.
    """
    at, calibration, scale = stride_slices(step), maps.calibration, maps.scale(COARSE)
    grid, flat = calibration.table.grid, np.moveaxis(maps.scale(1).flat, 0, -1)
    rows, columns = scale.kind.shape
    x, y = (
        first + scale.pitch_mm * np.arange(float(n))
        for first, n in ((scale.x_mm, columns), (scale.y_mm, rows))
    )
    rays = np.moveaxis(scale.rays[:2], 0, -1)
    depth, normals, direct = _lit(height_map, maps, (x, y), rays, COARSE)
    facing = np.ascontiguousarray(np.moveaxis(normals, -1, 0), np.float32)
    coarse = np.asarray(np.moveaxis(direct, -1, 0) / scale.flat, np.float32)
    lit, region = coarse, GridRegion((0, 0), (rows, columns))
    # Without interreflection, one round finds the shadows.
    # Each round of interreflection adds light that was reflected once more.
    for _ in range(3 if maps.membrane.interreflection > 0.0 else 1):
        light = around.light(region, SurfaceFacets(facing, depth, facing, lit))
        reflected = received(light.around, facing)
        lit = np.asarray(np.where(light.clear < CLEAR, 0.0, coarse) + reflected, np.float32)
    x, y = grid.x_mm[at[1]], grid.y_mm[at[0]]
    rays = np.nan_to_num(calibration.table.ray_slope[at])
    _, normals, fine = _lit(height_map, maps, (x, y), rays, step)
    column, row = np.meshgrid((x - scale.x_mm) / scale.pitch_mm, (y - scale.y_mm) / scale.pitch_mm)
    place = np.asarray(column, np.float32), np.asarray(row, np.float32)

    def sampled(plane: Float32Array) -> Float32Array:
        return np.asarray(cv2.remap(plane, *place, cv2.INTER_LINEAR), np.float32)

    facing = np.ascontiguousarray(np.moveaxis(normals, -1, 0), np.float32)
    around_here = np.stack([sampled(plane) for plane in light.around])
    reflected_here = np.moveaxis(received(around_here, facing), 0, -1)
    clear_here = np.stack([sampled(plane) for plane in light.clear], axis=-1)
    ratio = np.where(clear_here < CLEAR, 0.0, fine / flat[at]) + reflected_here
    background = maps.full.background[at]
    crosstalk = calibration.crosstalk.T
    image = (background * ratio) @ crosstalk / np.maximum(background @ crosstalk, LEAST_LIGHT)
    return np.asarray(np.where(maps.usable[at][..., None], image, np.nan), np.float32)


def _lit(
    height_map: HeightMap,
    maps: SensorMaps,
    nodes_mm: tuple[Float64Array, Float64Array],
    ray_slope: Float32Array,
    step: int,
) -> tuple[Float32Array, Float32Array, Float64Array]:
    """Return depth, normals and direct light of the surface that the rays of nodes meet."""
    pitch, surface, full = height_map.pitch_mm, maps.calibration.surface, maps.full
    first = np.array([height_map.x_mm[0], height_map.y_mm[0]])
    points = surface.points(np.stack(np.meshgrid(*nodes_mm), axis=-1))
    rays = np.dstack([ray_slope, -np.ones(points.shape[:2])])
    # From the plane of the boundary on, the whole surface is a depth along each ray.
    foot = points + points[..., 2:] * rays
    home = np.asarray(np.moveaxis((foot[..., :2] - first) / pitch, -1, 0), np.float32)
    per_depth = np.asarray(np.moveaxis(ray_slope, -1, 0) / pitch, np.float32)
    below = -height_map.height_mm
    place = intersect_depth(below, home, per_depth)
    slopes = surface_slopes(below, pitch, step=step)
    depth, slope_x, slope_y = (
        np.asarray(cv2.remap(values, place[0], place[1], cv2.INTER_LINEAR), np.float32)
        for values in (below, *slopes)
    )
    normals = normals_from_slopes(slope_x, slope_y)
    view, light = view_directions(np.asarray(ray_slope, np.float64)), full.membrane.light
    places = foot + depth[..., None] * rays
    direct = full.membrane.direct(full.led_positions_mm, places, normals.astype(np.float64), view)
    depth += points[..., 2].astype(np.float32)
    if full.membrane.terms:
        nearer_mm = depth * np.linalg.norm(rays, axis=-1)
        direct *= light.seen(nearer_mm, normals[..., 2], surface.normals(points[..., :2])[..., 2])
    return depth, normals, direct
