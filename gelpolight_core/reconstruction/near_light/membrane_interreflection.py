"""Light that a pressed membrane reflects onto itself, and shadows that it casts onto itself.

Both follow from the surface that the rounds have found so far: not from single normals, which noise
moves, but from the integrated depth. Facets have the areas and normals of that surface, summed as
vectors over its finest nodes; each node receives light with its own normal. Outside the region that
is solved the membrane is flat, and looks as in the background.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.membrane_masks import DARK_SHARE
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
from gelpolight_core.reconstruction.compiled import BLOCK, HALF, ONE, ZERO, part, single, whole
from gelpolight_core.reconstruction.height_map import COARSE

from .kernel import ray_ramps
from .kernel_structures import HIDDEN, JUDGED, GridRegion, PyramidLevel, RatioImage
from .sensor_maps import LEAST_SHARE, SensorMaps

LEVEL = 0.966
"""Within 15 degrees of the membrane at rest, what interreflected light depends on changes little
between nodes: a node for each tile is enough."""
RECEIVERS = 2
"""Nodes of the finest scale to one that receives light, along an axis. On walls, light is no
straight line between nodes of the coarsest scale: interpolated, it is 3 to 6 % low."""
CLEAR = 0.015
"""A light is hidden if the slope between its ray and the surface is less than this: an LED of 0.2
mm, 10 to 14 mm away, is then about half hidden."""
PLACING = 6
FIRST_STEP, STEP, SKIP = 1.5, 0.75, 6
"""Nodes along a ray to a light, between those at which the surface is compared with it; and how
many are skipped where the surface around is too low to hide the light."""

SHADOW_EDGE = 2
"""Nodes by which a shadow is extended at the finest scale: its edge is known to half a node of the
coarsest one. A node in its half-shadow would seem too steep."""
LEAST_SHADOW = 200
"""Nodes in a shadow whose mean light is known well enough for any camera's noise."""
OUTLIERS = 5
"""Window of the median over the normals that receive light, in nodes of the finest scale. Where a
light is hidden, two normals fit, and a single one that is too steep would add to its own light."""


class MembraneLight(NamedTuple):
    """Light of a pressed membrane on itself.

    Attributes
    ----------
    around : (12, rows, columns) float32
        As `RatioImage.around`, at the receivers.
    clear : (3, coarse rows, coarse columns) float32
        The least slope between the surface and the ray to each light.
    """

    around: Float32Array
    clear: Float32Array


def received(planes: Float32Array, normals: Float32Array) -> Float32Array:
    """Return the light (3, rows, columns) that nodes with unit normals (3, rows, columns) receive.

    Parameters
    ----------
    planes : (12, rows, columns) float32
        As `RatioImage.around`.
    normals : (3, rows, columns) float32
        Unit normals.
    """
    light = planes[:3].copy()
    for k in range(3):
        for i in range(3):
            light[k] += planes[3 + 3 * k + i] * normals[i]
    return np.maximum(light, 0.0, out=light)


class SurfaceFacets(NamedTuple):
    """A solved surface, and its means over nodes of the coarsest scale.

    Attributes
    ----------
    normals : (3, rows, columns) float32
        Unit normals at the scale of the depth.
    depth_mm : (rows, columns) float32
        Depth along the rays, at the same scale.
    facing : (3, coarse rows, coarse columns) float32
        Unit normals of the areas of the nodes, summed as vectors.
    ratio : (3, coarse rows, coarse columns) float32
        Press over background, by area.
    """

    normals: Float32Array
    depth_mm: Float32Array
    facing: Float32Array
    ratio: Float32Array

    @property
    def coarse_mm(self) -> Float32Array:
        """Depth along the rays at the coarsest scale."""
        return _blocks(self.depth_mm, len(self.depth_mm) // self.ratio.shape[1])

    def at_receivers(self) -> SurfaceFacets:
        """Return the surface with its depth and normals at the scale of the receivers, or wider."""
        nodes = RECEIVERS * len(self.depth_mm) // (COARSE * self.ratio.shape[1])
        if nodes <= 1:
            return self
        normals = _blocks(self.normals, nodes)
        normals /= np.sqrt((normals**2).sum(axis=0))
        return self._replace(normals=normals, depth_mm=_blocks(self.depth_mm, nodes))

    @classmethod
    def of(
        cls,
        depth_mm: Float32Array,
        ratio: Float32Array,
        corner: tuple[int, int],
        scale: PyramidLevel,
        run: Callable[..., None],
    ) -> SurfaceFacets:
        """Return the facets of a depth along the rays, in a region from `corner` of a scale.

        Parameters
        ----------
        depth_mm, ratio : (rows, columns), (3, rows, columns) float32
            Depth, and press over background.
        corner : (int, int)
            First row and column of the region.
        scale : PyramidLevel
            The scale.
        run : callable
            As `RowThreadPool.run`.
        """
        areas = surface_areas(depth_mm, corner, scale, run)
        nodes = COARSE // scale.factor
        size = np.sqrt((areas**2).sum(axis=0))
        facing, lit, whole = (_blocks(part, nodes) for part in (areas, ratio * size, size))
        facing = facing / np.sqrt((facing**2).sum(axis=0))
        normals = areas / size
        if nodes > 1:
            for plane in normals[:2]:
                plane[:] = cv2.medianBlur(plane, 2 * (OUTLIERS // (2 * scale.factor)) + 1)
            normals[2] = -np.sqrt(np.maximum(1.0 - normals[0] ** 2 - normals[1] ** 2, 0.0))
        return cls(normals, depth_mm, facing, lit / whole)


def _blocks(values: Float32Array, nodes: int) -> Float32Array:
    """Return means (..., rows, columns) over squares of nodes."""
    if nodes == 1:
        return values
    planes = values.reshape(-1, *values.shape[-2:])
    size = (values.shape[-1] // nodes, values.shape[-2] // nodes)
    means = [cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in planes]
    return np.reshape(np.stack(means), (*values.shape[:-2], *size[::-1]))


class InterreflectionModel:
    """Light and shadows of one sensor's membrane on itself.

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

    def light(self, region: GridRegion, surface: SurfaceFacets) -> MembraneLight:
        """Return the light and the shadows of a surface on itself.

        Parameters
        ----------
        region : GridRegion
            Nodes that are solved.
        surface : SurfaceFacets
            The surface there.
        """
        scale, at = self.maps.scale(COARSE), region.window(1)
        (above, _), (before, _) = self.maps.field.room
        corner = region.corner[0] + above, region.corner[1] + before
        of_field = GridRegion(corner, region.shape).window(1)
        whole = self._pressed(at, of_field, surface)
        clear = self._clearance(whole, of_field, surface.coarse_mm)
        membrane = self.maps.full.membrane
        if membrane.interreflection <= LEAST_SHARE:
            return MembraneLight(np.zeros((12, *region.shape), np.float32), clear)
        # Also where a node cannot be used: light between nodes is interpolated.
        factor = membrane.interreflection / -scale.flat[(slice(None), *at)]
        up = self._flat.normals[of_field]
        if membrane.terms:
            nearer_mm, down = surface.coarse_mm * self._path[of_field], surface.facing[2]
            factor *= np.moveaxis(membrane.light.seen(nearer_mm, down, up[..., 2]), -1, 0)
        level = self._level_light(whole, of_field) * np.concatenate([factor, factor.repeat(3, 0)])
        at_receivers = surface.at_receivers()
        shape = at_receivers.depth_mm.shape
        planes = np.stack([_enlarged(plane, shape) for plane in level])
        up_there = (_enlarged(np.ascontiguousarray(part), shape) for part in np.moveaxis(up, -1, 0))
        facing = np.zeros(shape, np.float32)
        for normal, upwards in zip(at_receivers.normals, up_there, strict=True):
            facing += normal * upwards
        rows, columns = nodes = np.nonzero(facing < LEVEL)
        planes[:, rows, columns] = self._tilted_light(whole, region, at_receivers, nodes).T
        return MembraneLight(planes, clear)

    def _level_light(self, whole: FacetSurface, of_field: tuple[slice, slice]) -> Float32Array:
        """Return the light (12, rows, columns) of nodes that are nearly level, from some of them.

        It is a function of the normal, as `RatioImage.around`.
        """
        rows, columns = whole.seen[of_field].shape[:2]
        pad = [(0, -rows % WIDE), (0, -columns % WIDE), (0, 0)]
        # Level nodes have the normal at rest, also in a tile with an edge or a wall.
        parts = whole.points_mm, self._flat.normals, whole.view
        points, normals, view = (_means(np.pad(p[of_field], pad, mode="edge")) for p in parts)
        some = points.shape[:2]
        first = np.array([of_field[0].start, of_field[1].start]) + WIDE // 2
        place = np.moveaxis(np.indices(some), 0, -1) * WIDE + first
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        view /= np.linalg.norm(view, axis=-1, keepdims=True)
        points, normals, view = (part.reshape(-1, 3) for part in (points, normals, view))
        receivers = LightReceivers(points, normals, view, place.reshape(-1, 2))
        light = np.moveaxis(self._gathered(whole, receivers).reshape(*some, 12), -1, 0)
        shape = some[0] * WIDE, some[1] * WIDE
        planes = [_enlarged(np.ascontiguousarray(part), shape) for part in light]
        return np.stack([plane[:rows, :columns] for plane in planes])

    def _tilted_light(
        self,
        whole: FacetSurface,
        region: GridRegion,
        surface: SurfaceFacets,
        nodes: tuple[NDArray[np.intp], ...],
    ) -> Float32Array:
        """Return the light (N, 12) of nodes (rows, columns) of a surface, over the background."""
        (rows, columns), shape = nodes, surface.depth_mm.shape
        per_coarse = shape[0] // region.shape[0]
        scale = self.maps.scale(COARSE // per_coarse)
        window = region.window(per_coarse)
        i, j = rows + window[0].start, columns + window[1].start
        depth, normals = surface.depth_mm[nodes], surface.normals[:, rows, columns].T
        rays = self.maps.scale(COARSE).rays[(slice(2), *region.window(1))]
        slope = np.stack([_enlarged(np.ascontiguousarray(r), shape)[nodes] for r in rays], axis=-1)
        height, rest_z = np.zeros_like(depth), -np.ones_like(depth)
        if scale.rest is not None:
            height, tilt_x, tilt_y = scale.rest[:, i, j]
            rest_z = -1.0 / np.sqrt(1.0 + tilt_x**2 + tilt_y**2)
        x, y = scale.x_mm + scale.pitch_mm * j, scale.y_mm + scale.pitch_mm * i
        moved = depth[:, None] * slope
        points = np.stack([x + moved[:, 0], y + moved[:, 1], height - depth], axis=-1)
        (above, _), (before, _) = self.maps.field.room
        place = np.stack([i // per_coarse + above, j // per_coarse + before], axis=-1)
        view = view_directions(slope.astype(np.float64))
        light = self._gathered(whole, LightReceivers(points, normals, view, place))
        membrane = self.maps.full.membrane
        share = membrane.interreflection / -scale.flat[:, i, j].T
        if membrane.terms:
            nearer_mm = depth * np.sqrt(1.0 + (slope**2).sum(axis=-1))
            share = share * membrane.light.seen(nearer_mm, normals[:, 2], rest_z)
        return np.asarray(light * np.concatenate([share, share.repeat(3, axis=1)], axis=1))

    def _gathered(self, whole: FacetSurface, receivers: LightReceivers) -> Float32Array:
        """Return light as a function of the normal (N, 12), of a membrane that absorbs nothing."""
        full, pitch_mm = self.maps.full, self.maps.scale(COARSE).pitch_mm
        light, by_normal = gather_interreflection(
            whole,
            receivers,
            full.led_positions_mm,
            full.membrane,
            pitch_mm,
            slab=self.maps.slab,
            run=self._workers.run,
        )
        constant = light - np.einsum("ijk,ik->ij", by_normal, receivers.normals)
        return np.concatenate([constant, by_normal.reshape(-1, 9)], axis=-1).astype(np.float32)

    def _pressed(
        self, at: tuple[slice, slice], of_field: tuple[slice, slice], surface: SurfaceFacets
    ) -> FacetSurface:
        """Return the whole membrane with a region of it pressed."""
        scale, depth = self.maps.scale(COARSE), surface.coarse_mm
        points, normals, view, emitted = (part.copy() for part in self._flat[:4])
        points[of_field][..., :2] += depth[..., None] * self._ray_slope[of_field]
        points[of_field][..., 2] -= depth
        normals[of_field] = np.moveaxis(surface.facing, 0, -1)
        usable_mask = (scale.kind[at] == 2)[..., None]
        share = self.maps.reflecting[of_field]
        reflected = ratio_reflected(np.moveaxis(surface.ratio, 0, -1), usable_mask, share)
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
        surface_mm = np.ascontiguousarray(-whole.points_mm[..., 2], np.float32)
        rows, columns = np.indices(pressed_mm.shape, dtype=np.float32)
        slope = np.moveaxis(self._ray_slope[at], -1, 0) * single(1.0 / scale.pitch_mm)
        # Outside the region nothing is pressed, and the surface is where its rays start.
        node = intersect_depth(pressed_mm, np.stack([columns, rows]), -slope)
        depth = np.ascontiguousarray(surface_mm[at])
        surface_mm[at] = cv2.remap(depth, node[0], node[1], cv2.INTER_LINEAR)
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


def _means(values: Float32Array) -> Float32Array:
    """Return means (rows, columns, 3) over the tiles of a field."""
    size = values.shape[1] // WIDE, values.shape[0] // WIDE
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA))


def _enlarged(plane: Float32Array, shape: tuple[int, ...]) -> Float32Array:
    """Return a plane at the nodes of a finer scale."""
    if plane.shape == shape:
        return plane
    return np.asarray(cv2.resize(plane, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR))


def with_interreflection(
    image: RatioImage, light: MembraneLight, normals: Float32Array
) -> RatioImage:
    """Return an image with the interreflected light and the shadows of a surface.

    Parameters
    ----------
    image : RatioImage
        Image of a region.
    light : MembraneLight
        Light of the surface on itself.
    normals : (3, rows, columns) float32
        Its unit normals at the image's nodes.
    """
    rows, columns = image.marks.shape

    planes = np.stack([_enlarged(plane, (rows, columns)) for plane in light.around])
    around = received(planes, normals)
    edge = SHADOW_EDGE * rows // (COARSE * light.clear.shape[1])
    window = np.ones((2 * edge + 1,) * 2, np.uint8)
    marks = image.marks | np.uint8(JUDGED)
    shadow = np.zeros((rows, columns), np.bool_)
    for k in range(3):
        hidden = _enlarged(light.clear[k], (rows, columns)) < CLEAR
        in_shadow = cv2.dilate(hidden.astype(np.uint8), window) > 0
        marks |= np.where(in_shadow, np.uint8(HIDDEN << k), np.uint8(0))
        shadow |= in_shadow
    # Two lights fit two normals: there the light is that of the surface so far.
    planes[:3, shadow], planes[3:, shadow] = around[:, shadow], 0.0
    return image._replace(around=planes, marks=marks)


def light_in_shadows(image: RatioImage, normals: Float32Array) -> Float32Array:
    """Return the share (3,) by which shadows are brighter than their interreflected light.

    Nothing else lights them: it is the error of this light in the press, by channel. It is 0 where
    a channel has hardly any shadow.

    Parameters
    ----------
    image : RatioImage
        From :func:`with_interreflection`.
    normals : (3, rows, columns) float32
        Unit normals at its nodes.
    """
    light, share = received(image.around, normals), np.zeros(3, np.float32)
    # Well inside: shadows were extended, and their true edge is in half-shadow.
    window = np.ones((4 * SHADOW_EDGE + 1,) * 2, np.uint8)
    for k in range(3):
        hidden = ((image.marks & np.uint8(HIDDEN << k)) > 0).astype(np.uint8)
        dark = (cv2.erode(hidden, window) > 0) & (image.marks & np.uint8(1 << k) == 0)
        expected, seen = light[k][dark], image.ratio[k][dark]
        if dark.sum() >= LEAST_SHADOW and expected.sum() > 0.0:
            # A speck is no light.
            seen = np.clip(seen, expected - DARK_SHARE, expected + DARK_SHARE)
            share[k] = seen.sum() / expected.sum() - 1.0
    return share


def surface_areas(
    depth_mm: Float32Array,
    corner: tuple[int, int],
    scale: PyramidLevel,
    run: Callable[..., None],
) -> Float32Array:
    """Return the areas of a surface as vectors (3, rows, columns), per area of the grid, z < 0.

    Parameters
    ----------
    depth_mm : (rows, columns) float32
        Depth along the rays.
    corner : (int, int)
        First row and column of the scale that it covers.
    scale : PyramidLevel
        The scale.
    run : callable
        As `RowThreadPool.run`.
    """
    areas = np.empty((3, *depth_mm.shape), np.float32)
    run(len(depth_mm), area_rows, depth_mm, scale, corner, areas)
    return areas


@part
def _at_rest(rest, i, j):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the slopes of the membrane at rest."""
    if rest is None:
        return ZERO, ZERO
    return rest[1, i, j], rest[2, i, j]


@whole
def area_rows(first, last, depth, scale, corner, areas):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Find the areas of the rows `first` to `last`, as :func:`surface_areas`."""
    rows, columns = depth.shape
    per_pitch = ONE / single(scale.pitch_mm)
    for i in range(first, last):
        above, below = max(i - 1, 0), min(i + 1, rows - 1)
        per_v = per_pitch / single(max(below - above, 1))
        for begin in range(0, columns, BLOCK):
            count = min(BLOCK, columns - begin)
            ramps = ray_ramps(scale, i + corner[0], begin + corner[1], count)
            for j in range(begin, begin + count):
                at, before, after = single(j - begin), max(j - 1, 0), min(j + 1, columns - 1)
                d = depth[i, j]
                d_u = (depth[i, after] - depth[i, before]) * per_pitch / single(after - before)
                d_v = (depth[below, j] - depth[above, j]) * per_v
                wx, wy = ramps[0] + at * ramps[1], ramps[2] + at * ramps[3]
                x_u = ONE + d_u * wx + d * (ramps[4] + at * ramps[5])
                y_u = d_u * wy + d * (ramps[6] + at * ramps[7])
                x_v = d_v * wx + d * (ramps[8] + at * ramps[9])
                y_v = ONE + d_v * wy + d * (ramps[10] + at * ramps[11])
                rest_u, rest_v = _at_rest(scale.rest, i + corner[0], j + corner[1])
                d_u, d_v = d_u - rest_u, d_v - rest_v
                areas[0, i, j] = d_v * y_u - d_u * y_v
                areas[1, i, j] = x_v * d_u - x_u * d_v
                areas[2, i, j] = x_v * y_u - x_u * y_v


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
