"""Light that a pressed membrane reflects onto itself, and shadows that it casts onto itself.

Both follow from the surface that the rounds have found so far. Outside the region that is solved
the membrane is flat, and looks as in the background.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.light.facet_interreflection import (
    WIDE,
    FacetSurface,
    LightReceivers,
    gather_interreflection,
    projected_facet_area,
    ratio_reflected,
)
from gelpolight_core.light.membrane_field import view_directions
from gelpolight_core.reconstruction.compiled import HALF, single, whole
from gelpolight_core.reconstruction.height_map import COARSE

from .kernel_structures import HIDDEN, JUDGED, GridRegion, PyramidLevel, RatioImage
from .sensor_maps import LEAST_SHARE, SensorMaps

LEVEL = 0.9986
"""Within 3 degrees of the membrane at rest, interreflected light changes little between nodes: some
nodes are enough."""
CLEAR = 0.015
"""A light is hidden if the slope between its ray and the surface is less than this: an LED of 0.2
mm, 10 to 14 mm away, is then about half hidden."""
PLACING = 6
FIRST_STEP, STEP, SKIP = 1.5, 0.75, 6
"""Nodes along a ray to a light, between those at which the surface is compared with it; and how
many are skipped where the surface around is too low to hide the light."""

GUIDE_NODES, GUIDE_SD, MOST_GUIDE = 1, 0.03, 4.0
"""Window around a node for this guidance, the noise of the image, and the highest press over
background."""


class InterreflectionModel:
    """Light and shadows of one sensor's membrane on itself, at the coarsest scale.

    Parameters
    ----------
    maps : SensorMaps
        Precomputed calibration data.
    workers : RowThreadPool
        Threads for blocks of rows.
    """

    def __init__(self, maps: SensorMaps, workers: RowThreadPool) -> None:
        self.maps, self._workers = maps, workers

    @cached_property
    def _ray_slope(self) -> Float32Array:
        """Ray slopes (rows, columns, 2) at the nodes of the field."""
        return np.moveaxis(self.maps.rays_of_field, 0, -1).astype(np.float32)

    @cached_property
    def _path(self) -> Float32Array:
        """Path along the rays (rows, columns) per mm of depth."""
        return np.asarray(np.sqrt(1.0 + (self._ray_slope**2).sum(axis=-1)), np.float32)

    @cached_property
    def _flat(self) -> FacetSurface:
        """The whole membrane at rest."""
        field, at_rest = self.maps.field, self.maps.calibration.surface
        places = np.stack(np.meshgrid(field.x_mm, field.y_mm), axis=-1)
        light = -np.moveaxis(self.maps.flat_of_field, 0, -1) * self.maps.reflecting[..., None]
        to_camera = view_directions(self._ray_slope.astype(np.float64))
        parts = (at_rest.points(places), at_rest.normals(places), to_camera, light)
        return FacetSurface(*(part.astype(np.float32) for part in parts))

    def light_and_clearance(
        self,
        region: GridRegion,
        ratio: Float32Array,
        surface: tuple[Float32Array, Float32Array, Float32Array],
        reflectance: float,
    ) -> tuple[Float32Array, Float32Array]:
        """Return interreflected light and the clearance of the rays to the lights.

        Parameters
        ----------
        region : GridRegion
            Nodes that are solved.
        ratio : (3, rows, columns) float32
            Press over background at the coarsest scale.
        surface : 3 of (rows, columns)
            Depth along the rays, and x and y of the normals.
        reflectance : float
            Reflectance of the membrane.

        Returns
        -------
        around : (3, rows, columns) float32
            In units of the background.
        clear : (3, rows, columns) float32
            The least slope between the surface and the ray to each light.
        """
        scale, at = self.maps.scale(COARSE), region.window(1)
        (above, _), (before, _) = self.maps.field.room
        corner = region.corner[0] + above, region.corner[1] + before
        of_field = GridRegion(corner, region.shape).window(1)
        whole = self._pressed(at, of_field, ratio, surface)
        clear = self._clearance(whole, of_field, surface[0])
        if reflectance <= LEAST_SHARE:
            return np.zeros_like(ratio), clear
        membrane, leds = self.maps.full.membrane, self.maps.full.led_positions_mm
        up = self._flat.normals[of_field]
        tilted = np.einsum("ijk,ijk->ij", whole.normals[of_field], up) < LEVEL
        some = np.zeros_like(tilted)
        some[WIDE // 2 :: WIDE, WIDE // 2 :: WIDE] = True
        receivers = [
            LightReceivers.on(whole, _within(of_field, part, whole.seen.shape[:2]))
            for part in (some, tilted)
        ]
        both = LightReceivers(*(np.concatenate(parts) for parts in zip(*receivers, strict=True)))
        light = gather_interreflection(
            whole, both, leds, membrane, scale.pitch_mm, slab=self.maps.slab, run=self._workers.run
        )
        some_rows = np.count_nonzero(some.any(axis=1))
        split = int(some.sum())
        coarse = light[:split].reshape(some_rows, -1, 3)
        size = region.shape[::-1]
        reflected = np.asarray(cv2.resize(coarse, size, interpolation=cv2.INTER_LINEAR))
        reflected[tilted] = light[split:]
        window = (slice(None), *at)
        around = np.moveaxis(reflected, -1, 0) / -scale.flat[window]
        share = membrane.interreflection
        excess = np.maximum(around - self.maps.returned[window] / share, 0.0)
        around = share * around + (reflectance - share) * excess
        around *= scale.kind[at] == 2
        if membrane.terms:
            depth, down = surface[0], whole.normals[of_field][..., 2]
            seen = membrane.light.seen(depth * self._path[of_field], down, up[..., 2])
            around *= np.moveaxis(seen, -1, 0)
        return np.ascontiguousarray(around, np.float32), clear

    def _pressed(
        self,
        at: tuple[slice, slice],
        of_field: tuple[slice, slice],
        ratio: Float32Array,
        surface: tuple[Float32Array, Float32Array, Float32Array],
    ) -> FacetSurface:
        """Return the whole membrane with a region of it pressed."""
        scale = self.maps.scale(COARSE)
        depth, nx, ny = surface
        points, normals, view, emitted = (part.copy() for part in self._flat[:4])
        points[of_field][..., :2] += depth[..., None] * self._ray_slope[of_field]
        points[of_field][..., 2] -= depth
        down = -np.sqrt(np.maximum(1.0 - nx * nx - ny * ny, 0.0))
        normals[of_field] = np.stack([nx, ny, down], axis=-1)
        usable_mask = (scale.kind[at] == 2)[..., None]
        share = self.maps.reflecting[of_field]
        reflected = ratio_reflected(np.moveaxis(ratio, 0, -1), usable_mask, share)
        emitted[of_field] = -np.moveaxis(scale.flat, 0, -1)[at] * reflected
        membrane = self.maps.full.membrane
        if membrane.terms:
            # It leaves for other parts before the path to the camera takes its share.
            emitted[of_field] /= membrane.light.to_camera(depth * self._path[of_field])
        curved = not self.maps.calibration.surface.flat
        rays = projected_facet_area(points, view, scale.pitch_mm) if curved else None
        return FacetSurface(points, normals, view, emitted, rays)

    def _clearance(
        self, whole: FacetSurface, at: tuple[slice, slice], pressed_mm: Float32Array
    ) -> Float32Array:
        """Return the least slope between the surface and the rays to the lights."""
        scale = self.maps.scale(COARSE)
        depth = np.ascontiguousarray(-whole.points_mm[..., 2], np.float32)
        pressed = np.zeros_like(depth)
        pressed[at] = pressed_mm
        rows, columns = np.indices(depth.shape, dtype=np.float32)
        per_pitch = single(1.0 / scale.pitch_mm)
        slope = np.moveaxis(self._ray_slope, -1, 0) * per_pitch
        node = intersect_depth(pressed, np.stack([columns, rows]), -slope)
        surface_mm = np.asarray(cv2.remap(depth, node[0], node[1], cv2.INTER_LINEAR), np.float32)
        points = np.ascontiguousarray(whole.points_mm[at], np.float32)
        leds = self.maps.full.led_positions_mm.astype(np.float32)
        x, y = self.maps.field.x_mm[0], self.maps.field.y_mm[0]
        origin = (single(x), single(y), single(scale.pitch_mm))
        return shadow_clearance(points, surface_mm, origin, leds, self._workers)


def shadow_clearance(
    points_mm: Float32Array,
    depth_mm: Float32Array,
    place: tuple[Any, Any, Any],
    leds_mm: Float32Array,
    workers: RowThreadPool,
) -> Float32Array:
    """Return the least slope (3, rows, columns) between a surface and the rays to the lights.

    Parameters
    ----------
    points_mm : (rows, columns, 3) float32
        Points from which the rays start.
    depth_mm : (whole rows, whole columns) float32
        The surface at true positions.
    place : 3 of float32
        First node of `depth_mm` (x, y), and the distance between its nodes.
    leds_mm : (3, 3) float32
        LED positions, sensor frame.
    workers : RowThreadPool
        Threads for blocks of rows.
    """
    clear = np.empty((3, *points_mm.shape[:2]), np.float32)
    around = cv2.dilate(depth_mm, np.ones((2 * SKIP + 3,) * 2, np.uint8))
    surface = (points_mm, depth_mm, around, place, leds_mm, single(depth_mm.max()))
    workers.run(len(points_mm), clear_rows, *surface, clear)
    return clear


def intersect_depth(
    depth_mm: Float32Array, home: Float32Array, slope: Float32Array
) -> Float32Array:
    """Return the node (2, ...), column and row, at which each ray meets the depth map.

    Half steps of the fixed point, as surfaces may fold.

    Parameters
    ----------
    depth_mm : (rows, columns) float32
        Depth map.
    home : (2, ...) float32
        Nodes, column and row.
    slope : (2, ...) float32
        Nodes per mm of depth.
    """
    place = home
    for _ in range(PLACING):
        depth = cv2.remap(depth_mm, place[0], place[1], cv2.INTER_LINEAR)
        place = HALF * (place + home + depth * slope)
    return place


def _within(
    at: tuple[slice, slice], part: NDArray[np.bool_], shape: tuple[int, ...]
) -> NDArray[np.bool_]:
    whole = np.zeros(shape, bool)
    whole[at] = part
    return whole


def with_interreflection(
    image: RatioImage, coarse: RatioImage, around: Float32Array, clear: Float32Array
) -> RatioImage:
    """Return an image with interreflected light and shadows, brought to its scale.

    Parameters
    ----------
    image, coarse : RatioImage
        Image of a region at one scale, and at the coarsest scale.
    around, clear : (3, rows, columns) float32
        From :meth:`InterreflectionModel.light_and_clearance`.
    """
    rows, columns = image.marks.shape
    marks = image.marks | np.uint8(JUDGED)
    enlarged = np.empty_like(image.ratio)
    for k in range(3):
        cv2.resize(around[k], (columns, rows), enlarged[k])
    if image.marks.shape != coarse.marks.shape:
        enlarged += _detail(image.ratio, coarse.ratio, around)
        np.maximum(enlarged, 0.0, out=enlarged)
    for k in range(3):
        hidden = cv2.resize(clear[k], (columns, rows)) < CLEAR
        marks |= np.where(hidden, np.uint8(HIDDEN << k), np.uint8(0))
    return image._replace(around=enlarged, marks=marks)


def _detail(fine: Float32Array, coarse: Float32Array, around: Float32Array) -> Float32Array:
    """Return the interreflected light at a finer scale, guided by the image at that scale.

    Interreflected light changes abruptly with the slope, as the image does: near each node it is a
    linear function of the three channels (He et al., guided image filtering, 2013).

    Parameters
    ----------
    fine : (3, rows, columns) float32
        Press over background at the finer scale.
    coarse, around : (3, rows / n, columns / n) float32
        Press over background, and interreflected light.
    """
    window = (2 * GUIDE_NODES + 1,) * 2

    def mean(values: Float32Array) -> Float32Array:
        return np.asarray(cv2.blur(values, window, borderType=cv2.BORDER_REPLICATE))

    guide, light = (np.ascontiguousarray(np.moveaxis(m, 0, -1)) for m in (coarse, around))
    guide = np.clip(guide, 0.0, MOST_GUIDE)
    centre, level = mean(guide), mean(light)
    guide_cov, light_cov = (np.empty((*guide.shape[:2], 3, 3), np.float32) for _ in range(2))
    for k in range(3):
        guide_cov[..., k] = mean(guide * guide[..., k, None]) - centre * centre[..., k, None]
        light_cov[..., k] = mean(guide * light[..., k, None]) - centre * level[..., k, None]
    guide_cov += np.float32(GUIDE_SD**2) * np.eye(3, dtype=np.float32)
    gains = np.linalg.solve(guide_cov, light_cov)
    size = fine.shape[2], fine.shape[1]
    detail = np.zeros_like(fine)
    for j in range(3):
        excess = np.clip(fine[j], 0.0, MOST_GUIDE) - cv2.resize(guide[..., j], size)
        for k in range(3):
            detail[k] += excess * cv2.resize(np.ascontiguousarray(gains[..., j, k]), size)
    return detail


def surface_normals(
    depth_mm: Float32Array, at: tuple[slice, slice], scale: PyramidLevel
) -> tuple[Float32Array, Float32Array]:
    """Return x and y of the normals of a depth along the rays (rows, columns).

    Parameters
    ----------
    depth_mm : (rows, columns) float32
        Depth of a region.
    at : 2 slices
        Nodes of the region.
    scale : PyramidLevel
        Coarsest scale of the whole field.
    """
    window = (slice(None), *at)
    wx, wy = scale.rays[:2][window]
    moved = depth_mm * wx, depth_mm * wy, depth_mm
    (x_v, x_u), (y_v, y_u), (d_v, d_u) = (np.gradient(m, scale.pitch_mm) for m in moved)
    if scale.rest is not None:
        d_u, d_v = np.stack([d_u, d_v]) - scale.rest[1:][window]
    x_u += 1.0
    y_v += 1.0
    n = (-d_u * y_v + d_v * y_u, -x_u * d_v + x_v * d_u, -(x_u * y_v - x_v * y_u))
    size = np.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
    return (n[0] / size).astype(np.float32), (n[1] / size).astype(np.float32)


@whole
def clear_rows(first, last, points, depth, around, place, leds, deepest, clear):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Find the clearance of the rays from points to the lights, rows `first` to `last`.

    Parameters
    ----------
    points : (rows, columns, 3) float32
        Points of the surface.
    depth : (whole rows, whole columns) float32
        At true positions.
    around : (whole rows, whole columns) float32
        The deepest of `depth` within `SKIP` nodes, and one more.
    place : tuple
        First node of `depth` (x, y), and the distance between its nodes.
    leds : (3, 3) float32
        LED positions, sensor frame.
    deepest : float
        Largest depth: rays below it are clear.
    clear : (3, rows, columns) float32
        Written.
    """
    x0, y0, pitch = place
    zero, one, most = single(0.0), single(1.0), single(2.0 * CLEAR)
    rows, columns = depth.shape
    for i in range(first, last):
        for k in range(3):
            for j in range(points.shape[1]):
                px, py, d = points[i, j, 0], points[i, j, 1], -points[i, j, 2]
                dx, dy = leds[k, 0] - px, leds[k, 1] - py
                far = np.sqrt(dx * dx + dy * dy) + single(1e-6)
                # The ray goes down towards the light: its depth grows.
                fall = (-leds[k, 2] - d) / far
                ux, uy = dx / far, dy / far
                least, t = most, single(FIRST_STEP) * pitch
                while t < far and d + fall * t < deepest:
                    x, y = (px + ux * t - x0) / pitch, (py + uy * t - y0) / pitch
                    if x < zero or y < zero or x > columns - one or y > rows - one:
                        break
                    m, n = min(int(y), rows - 2), min(int(x), columns - 2)
                    if fall > most and around[m, n] < d + (fall - most) * t:
                        t += single(SKIP) * pitch
                        continue
                    fx, fy = x - single(n), y - single(m)
                    up = depth[m, n] + fx * (depth[m, n + 1] - depth[m, n])
                    low = depth[m + 1, n] + fx * (depth[m + 1, n + 1] - depth[m + 1, n])
                    slope = fall - (up + fy * (low - up) - d) / t
                    least = slope if slope < least else least
                    t += single(STEP) * pitch
                clear[k, i, j] = least
