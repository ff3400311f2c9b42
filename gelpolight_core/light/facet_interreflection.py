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
"""Facets per wide facet along an axis, and wide facets per widest facet."""
NEAR = 1
"""A point gathers the facets of its own larger facet and of this number of larger facets around it.
Light from farther away comes from the larger facets of the whole field: walls mirror even distant
membrane."""

STRIDE, GRAZING_MM, PLACING = 2, 0.02, 3
"""Wide facets between those at which a line to a distant facet is compared with the surface, how
far it may be beyond it (as a ball of 1 mm radius bends between wide facets of 0.4 mm), and rounds
to find which facet is at a position."""

_single = np.float32
_0, _1, _HALF, _THIRD, _QUARTER = map(_single, (0.0, 1.0, 0.5, 1.0 / 3.0, 0.25))
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
"""Facets of a larger facet. They lie side by side, so that one instruction handles all of them."""

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
    parts = (*surface[:4], -surface.view[..., 2] if surface.across is None else surface.across)
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
) -> Float32Array:
    """Return the light from a surface via points to the camera, (N, 3), as `FacetSurface.seen`.

    The membrane absorbs nothing; multiply by its reflectance.

    Parameters
    ----------
    surface : FacetSurface
        Facets of the whole field; those beyond whole multiples of `WIDE` squared are left out.
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
    result = np.empty((len(points), 3), np.float32)
    if not len(points):
        return result
    wide = coarse_facets(surface)
    tile_rows = np.asarray(receivers.place[:, 0]) // WIDE
    rows = int(tile_rows.min()) - NEAR, int(tile_rows.max()) + NEAR + 1
    near = _facets(surface, leds_mm, membrane, side_mm, rows)
    medium = _facets(wide, leds_mm, membrane, WIDE * side_mm)
    widest = _facets(coarse_facets(wide), leds_mm, membrane, WIDE**2 * side_mm)
    gloss = (_single(membrane.gloss), _single(membrane.roughness**2)) if membrane.gloss else None
    loss_per_mm = membrane.light.loss_per_mm
    losses = tuple(map(_single, loss_per_mm)) if loss_per_mm.any() else None
    # What is not there is empty: for None, the loop would be compiled once more.
    mirrored = widest[:0]
    indices: tuple[Any, ...] = (_1, _1, _1)
    if slab is not None:
        mirrored = _mirrored(widest, slab.thickness_mm)
        lower = slab.lower_index
        indices = tuple(map(_single, (slab.refractive_index**2, lower, 1.0 / lower**2)))
    heights: tuple[Any, ...] = (_0, _0, _0, np.empty((0, 0), np.float32))
    if surface.across is not None:
        heights = _heights(wide.points_mm, WIDE * side_mm)
    fields = near, medium, widest, mirrored
    arguments = (points, fields, gloss, losses, indices, heights, result)
    if run is None:
        gather_rows(0, len(points), *arguments)
    else:
        run(len(points), gather_rows, *arguments)
    return result


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
    )
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
    """Return the surface on wide facets."""
    points, normals, view, light = (_means(part) for part in surface[:4])
    for unit in (normals, view):
        unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    rays = None if surface.across is None else _means(surface.across)
    return FacetSurface(points, normals, view, light, rays)


def _means(values: NDArray[np.floating]) -> Float32Array:
    size = (values.shape[1] // WIDE, values.shape[0] // WIDE)
    whole = np.ascontiguousarray(values[: size[1] * WIDE, : size[0] * WIDE], np.float32)
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA))


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
def _gather(sent, row, column, hole, p, n, v, s, gloss, losses, indices, hiding):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the light of a tile via a point to the camera, without the facets around a hole."""
    r_sum, g_sum, b_sum = _0, _0, _0
    tile = sent[row, column]
    if hiding is not None:
        heights, visible = hiding
        if heights[3].size:
            for j in range(_TILE):
                visible[j] = _is_seen(p, tile[0, j], tile[1, j], tile[2, j], heights)
    for j in range(_TILE):
        dx, dy, dz = tile[0, j] - p[0], tile[1, j] - p[1], tile[2, j] - p[2]
        per_r = _1 / sqrt(dx * dx + dy * dy + dz * dz + _TINY)
        ux, uy, uz = dx * per_r, dy * per_r, dz * per_r
        c = ux * n[0] + uy * n[1] + uz * n[2]
        out = -(ux * tile[3, j] + uy * tile[4, j] + uz * tile[5, j])
        c, out = (c if c > _0 else _0), (out if out > _0 else _0)
        part = c * out * tile[6, j] * per_r * per_r * _PER_PI
        if hole is not None:
            up, along = row * WIDE + j // WIDE - hole[0], column * WIDE + j % WIDE - hole[1]
            in_hole = -NEAR <= up <= NEAR and -NEAR <= along <= NEAR
            part = _0 if in_hole else part
        if indices is not None:
            part = part * _returned_share(-uz, indices)
        if hiding is not None:
            _, visible = hiding
            part = part * visible[j]
        if gloss is not None:
            share, a2 = gloss
            b2 = _1 - a2
            between = ux * v[0] + uy * v[1] + uz * v[2]
            lobe = share * a2 * _lobe(c, s, between, a2) / (c + sqrt(a2 + b2 * c * c))
            part = part * (_1 - share + lobe)
        r_part, g_part, b_part = part, part, part
        if losses is not None:
            r_loss, g_loss, b_loss = losses
            r_part = part * _passed(r_loss, per_r)
            g_part = part * _passed(g_loss, per_r)
            b_part = part * _passed(b_loss, per_r)
        if gloss is None:
            r_sum += r_part * tile[12, j]
            g_sum += g_part * tile[18, j]
            b_sum += b_part * tile[24, j]
        else:
            between = -(ux * tile[7, j] + uy * tile[8, j] + uz * tile[9, j])
            r_sum += r_part * (tile[12, j] + tile[11, j] * _lobe(tile[10, j], out, between, a2))
            between = -(ux * tile[13, j] + uy * tile[14, j] + uz * tile[15, j])
            g_sum += g_part * (tile[18, j] + tile[17, j] * _lobe(tile[16, j], out, between, a2))
            between = -(ux * tile[19, j] + uy * tile[20, j] + uz * tile[21, j])
            b_sum += b_part * (tile[24, j] + tile[23, j] * _lobe(tile[22, j], out, between, a2))
    return r_sum, g_sum, b_sum


@_part
def _around(sent, place, hole, p, n, v, s, gloss, losses):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the light of the tile at a place and of those around it, without a hole."""
    r_sum, g_sum, b_sum = _0, _0, _0
    for i in range(max(place[0] - NEAR, 0), min(place[0] + NEAR + 1, sent.shape[0])):
        for j in range(max(place[1] - NEAR, 0), min(place[1] + NEAR + 1, sent.shape[1])):
            r, g, b = _gather(sent, i, j, hole, p, n, v, s, gloss, losses, None, None)
            r_sum, g_sum, b_sum = r_sum + r, g_sum + g, b_sum + b
    return r_sum, g_sum, b_sum


@_part
def _everywhere(sent, hole, p, n, v, s, gloss, losses, indices, hiding):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the light of all tiles, without a hole."""
    r_sum, g_sum, b_sum = _0, _0, _0
    for i in range(sent.shape[0]):
        for j in range(sent.shape[1]):
            r, g, b = _gather(sent, i, j, hole, p, n, v, s, gloss, losses, indices, hiding)
            r_sum, g_sum, b_sum = r_sum + r, g_sum + g, b_sum + b
    return r_sum, g_sum, b_sum


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
def gather_rows(first, last, points, fields, gloss, losses, indices, heights, result):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Gather the light of the points `first` to `last`.

    Parameters
    ----------
    points : (points, 11) float32
        Point, normal, view, and its row and column among the facets of the field.
    fields : 4 of (tile rows, tile columns, planes, facets of a tile) float32
        Facets, wide and widest facets of the whole field, from :func:`emit_rows`, and the widest
        ones' mirror images in the lower face, none where no face returns light.
    gloss : (float, float) or None
        Share and squared roughness of the lobe.
    losses : (float, float, float) or None
        Loss of each colour along a path through the gel, per mm.
    indices : (float, float, float)
        Square of the elastomer's refractive index, the index of the layer that touches the air, and
        one over its square.
    heights : (float, float, float, (rows, columns) float32)
        From `_heights`; empty where no part hides another one.
    result : (points, 3) float32
        Written: light to the camera, in the facets' unit.
    """
    near, wide, widest, mirrored = fields
    visible = np.ones(_TILE, np.float32)
    for m in range(first, last):
        p, n = (
            (points[m, 0], points[m, 1], points[m, 2]),
            (points[m, 3], points[m, 4], points[m, 5]),
        )
        v = (points[m, 6], points[m, 7], points[m, 8])
        s = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
        s = s if s > _LEAST_VIEW else _LEAST_VIEW
        row, column = int(points[m, 9]), int(points[m, 10])
        a = row // WIDE, column // WIDE
        b = row // WIDE**2, column // WIDE**2
        r0, g0, b0 = _around(near, a, None, p, n, v, s, gloss, losses)
        r1, g1, b1 = _around(wide, b, a, p, n, v, s, gloss, losses)
        r2, g2, b2 = _everywhere(widest, b, p, n, v, s, gloss, losses, None, (heights, visible))
        r0, g0, b0 = r0 + r1 + r2, g0 + g1 + g2, b0 + b1 + b2
        r1, g1, b1 = _everywhere(mirrored, None, p, n, v, s, gloss, losses, indices, None)
        result[m, 0], result[m, 1], result[m, 2] = r0 + r1, g0 + g1, b0 + b1
