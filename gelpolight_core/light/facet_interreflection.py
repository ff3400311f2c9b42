"""Light from one part of the membrane to another, gathered over a given surface.

Each facet of the surface emits the light that the camera sees, converted to the other direction by
the glossy lobe. A point receives the light of all facets with its own response, so that the
direction of light from one wall to another is included. The light that the camera sees contains all
earlier reflections and shadows, so that one gathering is sufficient. The diffuse share is
Lambertian. The light that the elastomer's lower face returns (Fresnel; total reflection beyond the
critical angle) comes from the mirror images of the facets.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sqrt
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base import compiling
from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.geometry.refraction import LayerStack

from .membrane_brdf import MembraneBrdf
from .membrane_brdf_kernel import LEAST_COSINE, LEAST_VIEW

WIDE = 4
"""Facets of a tile along an axis."""
LEVELS = 6
"""Sizes of facets, each twice as wide as the one before. A point gathers the facets of its own tile
and of the tiles around it, of each size those that smaller facets do not cover, and of the widest
the whole field: walls mirror even distant membrane. Against the finest facets everywhere, light is
0.7 % low, as the middle of a facet stands for all of it; with facets 4 times as wide as the ones
before it is 2 to 3 % low."""

MIRRORED = 0.8
"""Widest facet for the light that the lower face returns, by its distance from the membrane. Mirror
images are twice as far away."""
HIDING, STRIDE, GRAZING_MM, PLACING = 2, 2, 0.02, 3
"""Size of the facets whose heights hide others, wide ones of 0.4 mm; wide facets between those at
which a line to a distant facet is compared with the surface; how far it may be beyond it (as a ball
of 1 mm radius bends between them); and rounds to find which facet is at a position."""

_single = np.float32
_0, _1, _TWO, _FOUR = map(_single, (0.0, 1.0, 2.0, 4.0))
_HALF, _THIRD, _QUARTER = map(_single, (0.5, 1.0 / 3.0, 0.25))
_PER_PI = _single(1.0 / pi)
_LEAST_VIEW, _LEAST_COSINE = _single(LEAST_VIEW), _single(LEAST_COSINE)
_LEAST_FACING = _single(0.1)
_NO_LIGHT = _single(1e-9)
_TINY, _GRAZING = _single(1e-6), _single(GRAZING_MM)
_POINT, _NORMAL, _AREA, _LIGHT, _PER_LED = 0, 3, 6, 7, 6
_PLANES = _LIGHT + 3 * _PER_LED
_DOWN = (_POINT + 2, _NORMAL + 2, *(_LIGHT + _PER_LED * k + 2 for k in range(3)))
"""Planes of z components, which have the opposite sign in a mirror image."""
_TILE = WIDE**2
"""Facets of a tile. They lie side by side, so that one instruction handles all of them."""
_SUMS = 15
"""Sums of a point: its light of each channel, for each the derivative by the normal (3) along the
directions that the light comes from, and along the view (1)."""

_part = compiling.part(fastmath=True, error_model="numpy")
_whole = compiling.whole(fastmath=True, error_model="numpy")


class Slab(NamedTuple):
    """The transparent layers between the membrane and the air below it.

    Attributes
    ----------
    thickness_mm : float
        As if it were all elastomer.
    refractive_index, lower_index : float
        Indices of the elastomer and of the layer that touches the air (the window, if any).
    """

    thickness_mm: float
    refractive_index: float
    lower_index: float

    @classmethod
    def of(cls, stack: LayerStack) -> Slab:
        """Return the slab of a sensor's layers, of which the first is air."""
        layers = list(zip(stack.thicknesses_mm, stack.indices, strict=True))[1:]
        index = stack.indices[-1]
        return cls(sum(t * index / n for t, n in layers), index, layers[0][1])


class FacetSurface(NamedTuple):
    """A surface on a grid of facets, as the camera sees it.

    Attributes
    ----------
    points_mm, normals, view : (rows, columns, 3)
        Sensor frame; unit normals, and unit directions to the camera.
    seen : (rows, columns, 3)
        Light of each channel that leaves for the camera, in units of :meth:`MembraneBrdf.response`
        times z / r^3; 0 where there is no membrane.
    across : (rows, columns), optional
        From :func:`projected_facet_area`; by default that of a flat membrane. Parts of a curved
        membrane light each other, unless a press between them blocks the light.
    """

    points_mm: NDArray[np.floating]
    normals: NDArray[np.floating]
    view: NDArray[np.floating]
    seen: NDArray[np.floating]
    across: NDArray[np.floating] | None = None


class ReceivedLight(NamedTuple):
    """Light that points receive and send to the camera.

    Attributes
    ----------
    light : (N, 3) float32
        Of each channel, as `FacetSurface.seen`.
    by_normal : (N, 3, 3) float32
        Derivative of each channel (second axis) by the point's normal, of any length. Of a diffuse
        membrane it is the irradiance vector over pi, and its product with the normal the light.
    """

    light: Float32Array
    by_normal: Float32Array


class LightReceivers(NamedTuple):
    """Points that receive light.

    Attributes
    ----------
    points_mm, normals, view : (N, 3)
        Sensor frame; unit normals, and unit directions to the camera.
    place : (N, 2)
        Row and column of the nearest facet.
    """

    points_mm: NDArray[np.floating]
    normals: NDArray[np.floating]
    view: NDArray[np.floating]
    place: NDArray[Any]

    @classmethod
    def on(cls, surface: FacetSurface, where: BoolArray) -> LightReceivers:
        """Return some (rows, columns) of a surface's own facets."""
        place = np.stack(np.nonzero(where), axis=-1)
        return cls(surface.points_mm[where], surface.normals[where], surface.view[where], place)


def projected_facet_area(
    points_mm: NDArray[np.floating], view: NDArray[np.floating], side_mm: float
) -> NDArray[np.floating]:
    """Return the area of the rays through a facet, across them, over its side squared.

    Parameters
    ----------
    points_mm, view : (rows, columns, 3)
        As in :class:`FacetSurface`; where the surface is along the rays matters little.
    side_mm : float
        Distance between facets.
    """
    down, along = np.gradient(points_mm, side_mm, axis=(0, 1))
    return np.asarray((np.cross(down, along) * view).sum(axis=-1))


def ratio_reflected(
    ratio: NDArray[np.floating], valid: BoolArray, reflecting: Float32Array
) -> Float32Array:
    """Return press over background (rows, columns, 3) of the light that facets reflect onto others.

    Parameters
    ----------
    ratio : (rows, columns, 3)
        As the camera sees it.
    valid : (rows, columns, 3) or (rows, columns, 1) bool
        Where the ratio is known; elsewhere facets reflect as much as untouched ones.
    reflecting : (rows, columns) float32
        Share of each facet that reflects light.
    """
    return np.asarray(np.where(valid, np.maximum(ratio, 0.0), 1.0) * reflecting[..., None])


def _facets(
    surface: FacetSurface,
    leds_mm: Float64Array,
    membrane: MembraneBrdf,
    side_mm: float,
    rows: tuple[int, int] | None = None,
) -> Float32Array:
    """Return the light that facets emit, (tile rows, tile columns, planes, facets of a tile).

    Parameters
    ----------
    surface : FacetSurface
        The surface, with facets at a distance of `side_mm`.
    leds_mm : (3, 3)
        LED positions, sensor frame.
    membrane : MembraneBrdf
        Its glossy lobe.
    side_mm : float
        Distance between facets, along the flat membrane.
    rows : (int, int), optional
        Tiles that are needed, first and last + 1; the others emit nothing.
    """
    parts = (*surface[:4], _across(surface))
    points, normals, view, light, rays = (np.ascontiguousarray(p, np.float32) for p in parts)
    tiles = [-(-n // WIDE) for n in points.shape[:2]]
    emitted = np.zeros((*tiles, _PLANES, _TILE), np.float32)
    first, last = rows or (0, tiles[0])
    gloss = _single(membrane.gloss), _single(membrane.roughness**2)
    leds, area = np.asarray(leds_mm, np.float32), _single(side_mm**2)
    first, last = max(first, 0), min(last, tiles[0])
    lobes = membrane.light if membrane.gloss and membrane.light.by_place else None
    if lobes is not None:
        gain = lobes.from_leds(leds_mm, surface.points_mm).astype(np.float32)
        light = light / gain
    emit_rows(first, last, points, normals, view, light, rays, leds, gloss, area, emitted)
    if lobes is not None:
        room = [(0, WIDE * n - size) for n, size in zip(tiles, gain.shape[:2], strict=True)]
        whole = np.pad(gain, [*room, (0, 0)]).reshape(tiles[0], WIDE, tiles[1], WIDE, 3)
        whole = whole.transpose(0, 2, 4, 1, 3).reshape(*tiles, 3, _TILE)
        for part in (4, 5):
            emitted[:, :, _LIGHT + part :: _PER_LED] *= whole
    return emitted


def gather_interreflection(
    surface: FacetSurface,
    receivers: LightReceivers,
    leds_mm: Float64Array,
    membrane: MembraneBrdf,
    side_mm: float,
    *,
    slab: Slab | None = None,
    run: Callable[..., None] | None = None,
) -> ReceivedLight:
    """Return the light from a surface via N points to the camera.

    The membrane absorbs nothing; multiply by its reflectance.

    Parameters
    ----------
    surface : FacetSurface
        Facets of the whole field.
    receivers : LightReceivers
        The points.
    leds_mm : (3, 3)
        LED positions, sensor frame.
    membrane : MembraneBrdf
        Its glossy lobe.
    side_mm : float
        Distance between facets.
    slab : Slab, optional
        Slab whose lower face returns light; by default no light is returned.
    run : callable, optional
        Calls a compiled function for parts of the points, like `RowThreadPool.run`; by default one
        thread.
    """
    points = np.concatenate(receivers, axis=-1).astype(np.float32)
    light, by_normal = np.empty((len(points), 3), "f4"), np.empty((len(points), 3, 3), "f4")
    received = ReceivedLight(light, by_normal)
    if not len(points):
        return received
    tile_rows = np.asarray(receivers.place[:, 0]) // WIDE
    rows = int(tile_rows.min()) - 1, int(tile_rows.max()) + 2
    sizes = [surface]
    # What hides a facet is found for its middle: where parts hide each other, none is that wide.
    while len(sizes) < (LEVELS if surface.across is None else LEVELS - 1):
        sizes.append(coarse_facets(sizes[-1]))
    fields = tuple(
        _facets(facets, leds_mm, membrane, 2**k * side_mm, None if k else rows)
        for k, facets in enumerate(sizes)
    )
    gloss = (_single(membrane.gloss), _single(membrane.roughness**2)) if membrane.gloss else None
    loss_per_mm = membrane.light.loss_per_mm
    losses = tuple(map(_single, loss_per_mm)) if loss_per_mm.any() else None
    # What is not there is empty: for None, the loop would be compiled once more.
    mirrored = fields[-1][:0]
    indices: tuple[Any, ...] = (_1, _1, _1)
    if slab is not None:
        # Far away, wide facets are enough.
        widths = [2**k * side_mm <= MIRRORED * slab.thickness_mm for k in range(1, len(sizes))]
        mirrored = _mirrored(fields[sum(widths)], slab.thickness_mm)
        lower = slab.lower_index
        indices = tuple(map(_single, (slab.refractive_index**2, lower, 1.0 / lower**2)))
    heights: tuple[Any, ...] = (_0, _0, _0, np.empty((0, 0), np.float32))
    if surface.across is not None:
        heights = _heights(sizes[HIDING].points_mm, 2**HIDING * side_mm)
    arguments = (points, fields, mirrored, gloss, losses, indices, heights, *received)
    if run is None:
        gather_rows(0, len(points), *arguments)
    else:
        run(len(points), gather_rows, *arguments)
    return received


def _heights(points_mm: NDArray[np.floating], side_mm: float) -> tuple[Any, ...]:
    """Return x and y of the first node, nodes per mm, and the heights at true positions."""
    first = points_mm[0, 0, :2]
    nodes = np.indices(points_mm.shape[:2]).astype(np.float32)[::-1]
    moved = np.moveaxis((points_mm[..., :2] - first) / side_mm, -1, 0).astype(np.float32) - nodes
    x, y = nodes
    for _ in range(PLACING):
        x, y = (n - cv2.remap(m, x, y, cv2.INTER_LINEAR) for n, m in zip(nodes, moved, strict=True))
    height = cv2.remap(points_mm[..., 2].astype(np.float32), x, y, cv2.INTER_LINEAR)
    return _single(first[0]), _single(first[1]), _single(1.0 / side_mm), height


def _mirrored(sent: Float32Array, depth_mm: float) -> Float32Array:
    """Return the mirror images of facets in a face at a distance below the membrane."""
    image = sent.copy()
    image[..., list(_DOWN), :] *= -1.0
    image[..., _POINT + 2, :] -= _single(2.0 * depth_mm)
    return image


def interreflection_of_flat(
    flat: NDArray[np.floating],
    points_mm: NDArray[np.floating],
    normals: NDArray[np.floating],
    view: NDArray[np.floating],
    leds_mm: Float64Array,
    membrane: MembraneBrdf,
    side_mm: float,
    slab: Slab,
) -> Float32Array:
    """Return the light that the membrane at rest receives from itself, (rows, columns, 3).

    The membrane absorbs nothing. It changes slowly, and is computed on some of the facets.

    Parameters
    ----------
    flat : (rows, columns, 3)
        Its light to the camera, as `FacetSurface.seen`.
    points_mm, normals, view, leds_mm, membrane, side_mm, slab
        As in :func:`gather_interreflection`.
    """
    rows, columns = flat.shape[:2]
    surface = FacetSurface(
        points_mm, normals, view, flat, projected_facet_area(points_mm, view, side_mm)
    )
    step = 2 * WIDE
    where = np.zeros((rows, columns), bool)
    where[::step, ::step] = True
    coarse = gather_interreflection(
        surface, LightReceivers.on(surface, where), leds_mm, membrane, side_mm, slab=slab
    ).light
    coarse = coarse.reshape(-(-rows // step), -(-columns // step), 3)
    x, y = np.meshgrid(*(np.arange(n, dtype=np.float32) / step for n in (columns, rows)))
    light = cv2.remap(coarse, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(light, np.float32)


def flat_light(
    points_mm: Float64Array,
    normals: Float64Array,
    view: Float64Array,
    reflecting: NDArray[np.floating],
    leds_mm: Float64Array,
    membrane: MembraneBrdf,
    side_mm: float,
    slab: Slab,
) -> tuple[Float64Array, Float64Array]:
    """Return direct and returned light of the membrane at rest, (..., 3) each.

    Parameters
    ----------
    points_mm, normals, view, leds_mm, membrane, side_mm, slab
        As in :func:`gather_interreflection`; what returns is that of a membrane that absorbs
        nothing.
    reflecting : (rows, columns)
        Share of each facet that reflects light.
    """
    direct = -membrane.direct(leds_mm, points_mm, normals, view)
    returned = np.zeros_like(direct)
    for _ in range(2):
        emitted = (direct + membrane.interreflection * returned) * reflecting[..., None]
        more = interreflection_of_flat(
            emitted, points_mm, normals, view, leds_mm, membrane, side_mm, slab
        )
        returned = np.asarray(more, np.float64)
    return direct, returned


def coarse_facets(surface: FacetSurface) -> FacetSurface:
    """Return the surface on facets twice as wide.

    Their areas are those of the smaller ones, summed as vectors, so that walls keep theirs. At an
    edge with an odd number of facets, the last ones are half empty.
    """
    rows, columns = (-(-n // 2) for n in surface.seen.shape[:2])
    parts = (np.ascontiguousarray(p, np.float32) for p in (*surface[:4], _across(surface)))
    vectors, across = np.empty((4, rows, columns, 3), "f4"), np.empty((rows, columns), "f4")
    coarse = FacetSurface(vectors[0], vectors[1], vectors[2], vectors[3], across)
    halve_rows(0, rows, *parts, *coarse)
    return coarse


def _across(surface: FacetSurface) -> NDArray[np.floating]:
    return -surface.view[..., 2] if surface.across is None else surface.across


@_whole
def halve_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, points, normals, view, light, rays, *coarse
):
    """Find facets twice as wide, rows `first` to `last`: fields of :class:`FacetSurface`."""
    points_2, normals_2, view_2, light_2, rays_2 = coarse
    rows, columns = rays.shape
    sums = np.empty((4, 3), np.float32)
    point, vector, sight, lit = sums[0], sums[1], sums[2], sums[3]
    for i in range(first, last):
        for j in range(rays_2.shape[1]):
            count, whole = _0, _0
            sums[:] = _0
            for m in range(2 * i, min(2 * i + 2, rows)):
                for n in range(2 * j, min(2 * j + 2, columns)):
                    v, normal = view[m, n], normals[m, n]
                    s = v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2]
                    area = rays[m, n] / max(s, _LEAST_FACING)
                    count, whole = count + _1, whole + area
                    for k in range(3):
                        point[k] += points[m, n, k]
                        sight[k] += v[k]
                        vector[k] += area * normal[k]
                        lit[k] += area * light[m, n, k]
            per_size = _1 / (sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2) + _NO_LIGHT)
            short = _1 / sqrt(sight[0] ** 2 + sight[1] ** 2 + sight[2] ** 2)
            s = (sight[0] * vector[0] + sight[1] * vector[1] + sight[2] * vector[2]) * short
            for k in range(3):
                points_2[i, j, k] = point[k] / count
                normals_2[i, j, k] = vector[k] * per_size
                view_2[i, j, k] = sight[k] * short
                light_2[i, j, k] = lit[k] / (whole + _NO_LIGHT)
            rays_2[i, j] = _QUARTER * max(s, _LEAST_FACING / per_size)


@_whole
def emit_rows(first, last, points, normals, view, light, rays, leds, gloss, area, emitted):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Find the light that facets emit, for the rows of tiles `first` to `last`.

    Parameters
    ----------
    points, normals, view, light : (rows, columns, 3) float32
        As in :class:`FacetSurface`.
    rays : (rows, columns) float32
        `FacetSurface.across`.
    leds : (3, 3) float32
        LED positions, sensor frame.
    gloss : (float, float)
        Share and squared roughness of the lobe.
    area : float
        Square of a facet's side.
    emitted : (tile rows, tile columns, planes, facets of a tile) float32
        Written: point, normal, area; for each LED its direction, the cosine to it, and the light
        that goes into the lobe and into the other directions.
    """
    share, a2 = gloss
    for i in range(first * WIDE, min(last * WIDE, points.shape[0])):
        for j in range(points.shape[1]):
            tile, m = emitted[i // WIDE, j // WIDE], i % WIDE * WIDE + j % WIDE
            p, n, v = points[i, j], normals[i, j], view[i, j]
            for k in range(3):
                tile[_POINT + k, m], tile[_NORMAL + k, m] = p[k], n[k]
            s = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
            # Along its ray, a facet covers the same part of the membrane at rest for any tilt.
            tile[_AREA, m] = area * rays[i, j] / max(s, _LEAST_FACING)
            s = max(s, _LEAST_VIEW)
            for k in range(3):
                x, y, z = leds[k, 0] - p[0], leds[k, 1] - p[1], leds[k, 2] - p[2]
                per_r = _1 / sqrt(x * x + y * y + z * z)
                x, y, z, strength = x * per_r, y * per_r, z * per_r, -z * per_r * per_r * per_r
                c = max(x * n[0] + y * n[1] + z * n[2], _0)
                root = sqrt(a2 + (_1 - a2) * c * c) + _TINY
                power = share * a2 * _PER_PI * c / (c + root)
                to_camera = power * _lobe(c, s, x * v[0] + y * v[1] + z * v[2], a2)
                expected = (_1 - share) * _PER_PI * max(c, _LEAST_COSINE) + to_camera
                # Share of the expected light: less is shadow, more does not come from the LED.
                lit = min(max(light[i, j, k] / max(expected * strength, _NO_LIGHT), _0), _1)
                at = _LIGHT + _PER_LED * k
                tile[at, m], tile[at + 1, m], tile[at + 2, m], tile[at + 3, m] = x, y, z, c
                tile[at + 4, m] = power * lit * strength
                tile[at + 5, m] = max(light[i, j, k] - to_camera * lit * strength, _0)


@_part
def _lobe(c, s, between, a2):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return D / (s + root) of the lobe between two directions, from their cosines."""
    b2 = _1 - a2
    half = _single(2.0) + between + between + _TINY
    both = (c + s) * (c + s)
    width = half / (half - (both if both < half else half) * b2)
    return width * width / (s + sqrt(a2 + b2 * s * s))


@_part
def _passed(loss, per_r):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the share of light that passes a path of 1 / per_r.

    It is within 1e-3 of the exponential where more than 40 % passes, and within 0.012 anywhere.
    """
    x = loss / per_r
    return _1 / (_1 + x * (_1 + _HALF * x * (_1 + _THIRD * x * (_1 + _QUARTER * x))))


@_part
def _is_seen(p, x, y, z, heights):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return 1 where a line from a point p to x, y and z stays inside of the elastomer, else 0."""
    x0, y0, per_mm, height = heights
    start, rise = ((p[0] - x0) * per_mm, (p[1] - y0) * per_mm), z - p[2]
    along, down = (x - p[0]) * per_mm, (y - p[1]) * per_mm
    count = int(max(abs(down), abs(along))) // STRIDE
    for k in range(1, count):
        t = _single(k) / _single(count)
        x, y = start[0] + t * along, start[1] + t * down
        i, j = min(max(int(y), 0), height.shape[0] - 2), min(max(int(x), 0), height.shape[1] - 2)
        y, x = y - _single(i), x - _single(j)
        up = height[i, j] + x * (height[i, j + 1] - height[i, j])
        low = height[i + 1, j] + x * (height[i + 1, j + 1] - height[i + 1, j])
        if p[2] + t * rise > up + y * (low - up) + _GRAZING:
            return _0
    return _1


@_part
def _gather(sent, row, column, hole, p, n, v, s, gloss, losses, indices, hiding, sums):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Add the light of a tile, without the facets in a hole, to the sums of a point."""
    tile = sent[row, column]
    if hiding is not None:
        heights, visible, far = hiding
        if heights[3].size:
            for j in range(_TILE):
                seen = _1
                if far:
                    seen = _is_seen(p, tile[0, j], tile[1, j], tile[2, j], heights)
                visible[j] = seen
    r0, r1, r2, r3, r4 = _0, _0, _0, _0, _0
    g0, g1, g2, g3, g4 = _0, _0, _0, _0, _0
    b0, b1, b2, b3, b4 = _0, _0, _0, _0, _0
    for j in range(_TILE):
        dx, dy, dz = tile[0, j] - p[0], tile[1, j] - p[1], tile[2, j] - p[2]
        per_r = _1 / sqrt(dx * dx + dy * dy + dz * dz + _TINY)
        ux, uy, uz = dx * per_r, dy * per_r, dz * per_r
        c = ux * n[0] + uy * n[1] + uz * n[2]
        out = -(ux * tile[3, j] + uy * tile[4, j] + uz * tile[5, j])
        on = _1 if c > _0 else _0
        c, out = (c if c > _0 else _0), (out if out > _0 else _0)
        part = on * out * tile[6, j] * per_r * per_r * _PER_PI
        if hole is not None:
            up, along = row * WIDE + j // WIDE, column * WIDE + j % WIDE
            in_hole = hole[0] <= up < hole[1] and hole[2] <= along < hole[3]
            part = _0 if in_hole else part
        if indices is not None:
            part = part * _returned_share(-uz, indices)
        if hiding is not None:
            _, visible, _ = hiding
            part = part * visible[j]
        # Response to a light from there, its derivatives by c and s.
        f, by_c, by_s = c, _1, _0
        if gloss is not None:
            share, a2 = gloss
            b2l = _1 - a2
            between = ux * v[0] + uy * v[1] + uz * v[2]
            root_c, root_s = sqrt(a2 + b2l * c * c), sqrt(a2 + b2l * s * s)
            lit, seen = _1 / (c + root_c), _1 / (s + root_s)
            half, both = _TWO + between + between + _TINY, (c + s) * (c + s)
            both = both if both < half else half
            width = _1 / (half - both * b2l)
            lobe = share * a2 * half * half * width * width * lit * seen
            turn = _FOUR * b2l * (c + s) * width
            f = c * (_1 - share + lobe)
            by_c = _1 - share + lobe * (_1 + c * (turn - (_1 + b2l * c / root_c) * lit))
            by_s = c * lobe * (turn - (_1 + b2l * s / root_s) * seen)
        r_part, g_part, b_part = part, part, part
        if losses is not None:
            r_loss, g_loss, b_loss = losses
            r_part = part * _passed(r_loss, per_r)
            g_part = part * _passed(g_loss, per_r)
            b_part = part * _passed(b_loss, per_r)
        if gloss is None:
            r_part, g_part, b_part = (
                r_part * tile[12, j],
                g_part * tile[18, j],
                b_part * tile[24, j],
            )
        else:
            between = -(ux * tile[7, j] + uy * tile[8, j] + uz * tile[9, j])
            r_part *= tile[12, j] + tile[11, j] * _lobe(tile[10, j], out, between, a2)
            between = -(ux * tile[13, j] + uy * tile[14, j] + uz * tile[15, j])
            g_part *= tile[18, j] + tile[17, j] * _lobe(tile[16, j], out, between, a2)
            between = -(ux * tile[19, j] + uy * tile[20, j] + uz * tile[21, j])
            b_part *= tile[24, j] + tile[23, j] * _lobe(tile[22, j], out, between, a2)
        r0 += r_part * f
        g0 += g_part * f
        b0 += b_part * f
        ux, uy, uz = by_c * ux, by_c * uy, by_c * uz
        r1 += r_part * ux
        r2 += r_part * uy
        r3 += r_part * uz
        g1 += g_part * ux
        g2 += g_part * uy
        g3 += g_part * uz
        b1 += b_part * ux
        b2 += b_part * uy
        b3 += b_part * uz
        if gloss is not None:
            r4 += r_part * by_s
            g4 += g_part * by_s
            b4 += b_part * by_s
    for k, value in enumerate((r0, g0, b0, r1, r2, r3, r4, g1, g2, g3, g4, b1, b2, b3, b4)):
        sums[k] += value


@_part
def _returned_share(up, indices):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the share of light that the lower face returns, with cosine `up` in the elastomer."""
    index2, index, per_index2 = indices
    sine2 = index2 * (_1 - up * up)
    out = sqrt(_1 - sine2 if sine2 < _1 else _0)
    up = sqrt(_1 - sine2 * per_index2)
    # Both polarisations over one denominator: divisions are slow.
    a, b, c, d = index * up - out, index * up + out, index * out - up, index * out + up
    across, along, whole = a * d, c * b, b * d
    return _HALF * (across * across + along * along) / (whole * whole)


@_whole
def gather_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, points, fields, mirrored, gloss, losses, indices, heights, light, by_normal
):
    """Gather the light of the points `first` to `last`.

    Parameters
    ----------
    points : (points, 11) float32
        Point, normal, view, and its row and column among the facets of the field.
    fields : tuple of (tile rows, tile columns, planes, facets of a tile) float32
        Facets of the whole field, from :func:`emit_rows`, each twice as wide as those before.
    mirrored : (tile rows, tile columns, planes, facets of a tile) float32
        The widest ones' mirror images in the lower face, none where no face returns light.
    gloss : (float, float) or None
        Share and squared roughness of the lobe.
    losses : (float, float, float) or None
        Loss of each colour along a path through the gel, per mm.
    indices : (float, float, float)
        Square of the elastomer's refractive index, the index of the layer that touches the air, and
        one over its square.
    heights : (float, float, float, (rows, columns) float32)
        From `_heights`; empty where no part hides another one.
    light, by_normal : (points, 3), (points, 3, 3) float32
        Written: the fields of :class:`ReceivedLight`.
    """
    visible, sums = np.ones(_TILE, np.float32), np.empty(_SUMS, np.float32)
    for m in range(first, last):
        p, n = (
            (points[m, 0], points[m, 1], points[m, 2]),
            (points[m, 3], points[m, 4], points[m, 5]),
        )
        v = (points[m, 6], points[m, 7], points[m, 8])
        s = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
        s = s if s > _LEAST_VIEW else _LEAST_VIEW
        row, column = int(points[m, 9]) // WIDE, int(points[m, 10]) // WIDE
        sums[:] = _0
        hole = (0, 0, 0, 0)
        for level in range(len(fields)):
            sent = fields[level]
            rows, columns = (row - 1, row + 2), (column - 1, column + 2)
            if level == len(fields) - 1:
                rows, columns = (0, sent.shape[0]), (0, sent.shape[1])
            hiding = heights, visible, level > HIDING
            for i in range(max(rows[0], 0), min(rows[1], sent.shape[0])):
                for j in range(max(columns[0], 0), min(columns[1], sent.shape[1])):
                    _gather(sent, i, j, hole, p, n, v, s, gloss, losses, None, hiding, sums)
            # Of facets twice as wide, those that these tiles cover.
            above, before = WIDE // 2 * (row - 1), WIDE // 2 * (column - 1)
            hole = (above, above + 3 * WIDE // 2, before, before + 3 * WIDE // 2)
            row, column = row // 2, column // 2
        for i in range(mirrored.shape[0]):
            for j in range(mirrored.shape[1]):
                _gather(mirrored, i, j, None, p, n, v, s, gloss, losses, indices, None, sums)
        for k in range(3):
            light[m, k] = sums[k]
            for i in range(3):
                by_normal[m, k, i] = sums[3 + 4 * k + i] + sums[6 + 4 * k] * v[i]
