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
import numba
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.refraction import LayerStack
from gelpolight_core.reflectance.membrane import UP, Membrane
from gelpolight_core.reflectance.membrane_kernel import LEAST_COSINE, LEAST_VIEW

Map = NDArray[np.float32]
WIDE = 4
"""Facets per wide facet along an axis, and wide facets per widest facet."""
NEAR = 1
"""A point gathers the facets of its own larger facet and of this number of larger facets around it.
Light from farther away comes from the larger facets of the whole field: walls mirror even distant
membrane."""

_single = np.float32
_0, _1, _HALF = _single(0.0), _single(1.0), _single(0.5)
_PER_PI = _single(1.0 / pi)
_LEAST_VIEW = _single(LEAST_VIEW)
_TINY = _single(1e-6)
_POINT, _NORMAL, _AREA, _LIGHT = 0, 3, 6, 7
_PLANES = 25
_DOWN = (_POINT + 2, _NORMAL + 2, _LIGHT + 2, _LIGHT + 8, _LIGHT + 14)
"""Planes of z components, which have the opposite sign in a mirror image."""

_part = numba.njit(nogil=True, fastmath=True, error_model="numpy", forceinline=True, cache=True)
_whole = numba.njit(nogil=True, fastmath=True, error_model="numpy", cache=True)


class Slab(NamedTuple):
    """What is between the membrane and the air below it.

    Attributes
    ----------
    thickness_mm : float
        As if it were all elastomer.
    refractive_index : float
        Refractive index of the elastomer.
    """

    thickness_mm: float
    refractive_index: float

    @classmethod
    def of(cls, stack: LayerStack) -> Slab:
        """Return the slab of a sensor's layers, of which the first is air."""
        layers = list(zip(stack.thicknesses_mm, stack.indices, strict=True))[1:]
        index = stack.indices[-1]
        return cls(sum(t * index / n for t, n in layers), index)


class Surface(NamedTuple):
    """A surface on a grid of facets, as the camera sees it.

    Attributes
    ----------
    points_mm, normals, view : (rows, columns, 3)
        Sensor frame; unit normals, and unit directions to the camera.
    seen : (rows, columns, 3)
        Light of each channel to the camera, in units of :meth:`Membrane.response` times z / r^3;
        0 where there is no membrane.
    """

    points_mm: NDArray[np.floating]
    normals: NDArray[np.floating]
    view: NDArray[np.floating]
    seen: NDArray[np.floating]


class Receivers(NamedTuple):
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
    def on(cls, surface: Surface, where: NDArray[np.bool_]) -> Receivers:
        """Return some (rows, columns) of a surface's own facets."""
        place = np.stack(np.nonzero(where), axis=-1)
        return cls(surface.points_mm[where], surface.normals[where], surface.view[where], place)


def ratio_reflected(ratio: NDArray[np.floating], known: NDArray[np.bool_], reflecting: Map) -> Map:
    """Return press over background (rows, columns, 3) of the light that facets reflect onto others.

    Parameters
    ----------
    ratio : (rows, columns, 3)
        As the camera sees it.
    known : (rows, columns, 3) or (rows, columns, 1) bool
        Where the ratio is known; elsewhere facets reflect as much as untouched ones.
    reflecting : (rows, columns) float32
        Share of each facet that reflects light.
    """
    return np.asarray(np.where(known, np.maximum(ratio, 0.0), 1.0) * reflecting[..., None])


def facets(
    surface: Surface, leds_mm: NDArray[np.float64], membrane: Membrane, side_mm: float
) -> Map:
    """Return the light that facets emit, (planes, rows, columns), for :func:`gather_rows`.

    Parameters
    ----------
    surface : Surface
        The surface, with facets at a distance of `side_mm`.
    leds_mm : (3, 3)
        Sensor frame.
    membrane : Membrane
        Its glossy lobe.
    side_mm : float
        Distance between facets, along the flat membrane.
    """
    points, normals, view, seen = (np.asarray(part, np.float32) for part in surface)
    made = np.empty((_PLANES, *seen.shape[:2]), np.float32)
    made[_POINT : _POINT + 3] = np.moveaxis(points, -1, 0)
    made[_NORMAL : _NORMAL + 3] = np.moveaxis(normals, -1, 0)
    # Along its ray, a facet covers the same part of the flat membrane for any tilt.
    facing = np.maximum(np.einsum("ijc,ijc->ij", view, normals), 0.1)
    made[_AREA] = side_mm**2 * -view[..., 2] / facing
    a2 = membrane.roughness**2
    s = np.maximum(facing, LEAST_VIEW)
    for k in range(3):
        to_led = np.asarray(leds_mm[k], np.float32) - points
        distance = np.sqrt(np.einsum("ijc,ijc->ij", to_led, to_led))
        light = to_led / distance[..., None]
        c = np.maximum(np.einsum("ijc,ijc->ij", light, normals), 0.0)
        half = 2.0 + 2.0 * np.einsum("ijc,ijc->ij", light, view)
        t2 = (c + s) ** 2 / np.maximum(half, _TINY)
        width = 1.0 / (1.0 - np.minimum(t2, 1.0) * (1.0 - a2))
        power = membrane.gloss * a2 / pi * c / (c + np.sqrt(a2 + (1.0 - a2) * c * c) + _TINY)
        to_camera = power * width**2 / (s + np.sqrt(a2 + (1.0 - a2) * s * s))
        expected = (1.0 - membrane.gloss) / pi * np.maximum(c, LEAST_COSINE) + to_camera
        # Share of the expected light: less is shadow, more does not come from the LED.
        strength = -to_led[..., 2] / distance**3
        lit = np.clip(seen[..., k] / np.maximum(expected * strength, 1e-9), 0.0, 1.0) * strength
        at = _LIGHT + 6 * k
        made[at : at + 3] = np.moveaxis(light, -1, 0)
        made[at + 3] = c
        made[at + 4] = power * lit
        made[at + 5] = np.maximum(seen[..., k] - to_camera * lit, 0.0)
    return made


def gathered(
    surface: Surface,
    at: Receivers,
    leds_mm: NDArray[np.float64],
    membrane: Membrane,
    side_mm: float,
    *,
    slab: Slab | None = None,
    run: Callable[..., None] | None = None,
) -> Map:
    """Return the light from a surface via points to the camera, (N, 3), as `Surface.seen`.

    The membrane absorbs nothing; multiply by its reflectance.

    Parameters
    ----------
    surface : Surface
        Facets of the whole field; those beyond whole multiples of `WIDE` squared are left out.
    at : Receivers
        The points.
    leds_mm : (3, 3)
        Sensor frame.
    membrane : Membrane
        Its glossy lobe.
    side_mm : float
        Distance between facets.
    slab : Slab, optional
        Slab whose lower face returns light; by default no light is returned.
    run : callable, optional
        Calls a compiled function for parts of the points, like `RowWorkers.run`; by default one
        thread.
    """
    near = facets(surface, leds_mm, membrane, side_mm)
    wide = widened(surface)
    middle = facets(wide, leds_mm, membrane, WIDE * side_mm)
    far = facets(widened(wide), leds_mm, membrane, WIDE**2 * side_mm)
    points = np.concatenate(at, axis=-1).astype(np.float32)
    result = np.empty((len(points), 3), np.float32)
    gloss = (_single(membrane.gloss), _single(membrane.roughness**2)) if membrane.gloss else None
    mirrored, index2 = far, _0
    if slab is not None:
        mirrored, index2 = _mirrored(far, slab.thickness_mm), _single(slab.refractive_index**2)
    fields = (near, middle, far, mirrored)
    if run is None:
        gather_rows(0, len(points), points, fields, gloss, index2, result)
    else:
        run(len(points), gather_rows, points, fields, gloss, index2, result)
    return result


def _mirrored(sent: Map, depth_mm: float) -> Map:
    """Return the mirror images of facets in a face at a distance below the membrane."""
    image = sent.copy()
    image[list(_DOWN)] *= -1.0
    image[_POINT + 2] -= _single(2.0 * depth_mm)
    return image


def returned_to_flat(
    flat: NDArray[np.floating],
    points_mm: NDArray[np.floating],
    view: NDArray[np.floating],
    leds_mm: NDArray[np.float64],
    membrane: Membrane,
    side_mm: float,
    slab: Slab,
) -> Map:
    """Return the light that the lower face returns to the flat membrane, (rows, columns, 3).

    The membrane absorbs nothing. It changes slowly, and is computed on some of the facets.

    Parameters
    ----------
    flat : (rows, columns, 3)
        Light of the flat membrane to the camera, as `Surface.seen`.
    points_mm, view, leds_mm, membrane, side_mm, slab
        As in :func:`gathered`.
    """
    rows, columns = flat.shape[:2]
    surface = Surface(points_mm, np.broadcast_to(UP, view.shape), view, flat)
    step = 2 * WIDE
    where = np.zeros((rows, columns), bool)
    where[::step, ::step] = True
    some = gathered(surface, Receivers.on(surface, where), leds_mm, membrane, side_mm, slab=slab)
    some = some.reshape(-(-rows // step), -(-columns // step), 3)
    at = np.meshgrid(*(np.arange(n, dtype=np.float32) / step for n in (columns, rows)))
    return np.asarray(
        cv2.remap(some, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def flat_light(
    points_mm: NDArray[np.float64],
    view: NDArray[np.float64],
    reflecting: NDArray[np.floating],
    leds_mm: NDArray[np.float64],
    membrane: Membrane,
    side_mm: float,
    slab: Slab,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return direct light of the flat membrane, and what a lower face returns, (..., 3) each.

    Parameters
    ----------
    points_mm, view, leds_mm, membrane, side_mm, slab
        As in :func:`gathered`; what returns is that of a membrane that absorbs nothing.
    reflecting : (rows, columns)
        Share of each facet that reflects light.
    """
    direct = -membrane.direct(leds_mm, points_mm, np.array(UP), view)
    returned = np.zeros_like(direct)
    for _ in range(2):
        seen = (direct + membrane.interreflection * returned) * reflecting[..., None]
        more = returned_to_flat(seen, points_mm, view, leds_mm, membrane, side_mm, slab)
        returned = np.asarray(more, np.float64)
    return direct, returned


def widened(surface: Surface) -> Surface:
    """Return the surface on wide facets."""
    points, normals, view, seen = (_means(part) for part in surface)
    for unit in (normals, view):
        unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    return Surface(points, normals, view, seen)


def _means(values: NDArray[np.floating]) -> Map:
    size = (values.shape[1] // WIDE, values.shape[0] // WIDE)
    whole = np.ascontiguousarray(values[: size[1] * WIDE, : size[0] * WIDE], np.float32)
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA))


@_part
def _lobe(c, s, between, a2):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return D / (s + root) of the lobe between two directions, from their cosines."""
    b2 = _1 - a2
    t2 = (c + s) * (c + s) / (_single(2.0) + between + between + _TINY)
    t2 = t2 if t2 < _1 else _1
    width = _1 / (_1 - t2 * b2)
    return width * width / (s + sqrt(a2 + b2 * s * s))


@_part
def _gather(sent, i, left, right, p, n, v, s, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the light of a row of facets via a point to the camera."""
    r_sum, g_sum, b_sum = _0, _0, _0
    for j in range(left, right):
        dx, dy, dz = sent[0, i, j] - p[0], sent[1, i, j] - p[1], sent[2, i, j] - p[2]
        r2 = dx * dx + dy * dy + dz * dz + _TINY
        short = _1 / sqrt(r2)
        ux, uy, uz = dx * short, dy * short, dz * short
        c = ux * n[0] + uy * n[1] + uz * n[2]
        out = -(ux * sent[3, i, j] + uy * sent[4, i, j] + uz * sent[5, i, j])
        c, out = (c if c > _0 else _0), (out if out > _0 else _0)
        part = c * out * sent[6, i, j] * short * short
        if gloss is None:
            part = part * _PER_PI
            r_sum += part * sent[12, i, j]
            g_sum += part * sent[18, i, j]
            b_sum += part * sent[24, i, j]
        else:
            share, a2 = gloss
            b2 = _1 - a2
            between = ux * v[0] + uy * v[1] + uz * v[2]
            lobe = share * a2 * _lobe(c, s, between, a2) / (c + sqrt(a2 + b2 * c * c))
            part = part * _PER_PI * (_1 - share + lobe)
            between = -(ux * sent[7, i, j] + uy * sent[8, i, j] + uz * sent[9, i, j])
            lobe = _lobe(sent[10, i, j], out, between, a2)
            r_sum += part * (sent[12, i, j] + sent[11, i, j] * lobe)
            between = -(ux * sent[13, i, j] + uy * sent[14, i, j] + uz * sent[15, i, j])
            lobe = _lobe(sent[16, i, j], out, between, a2)
            g_sum += part * (sent[18, i, j] + sent[17, i, j] * lobe)
            between = -(ux * sent[19, i, j] + uy * sent[20, i, j] + uz * sent[21, i, j])
            lobe = _lobe(sent[22, i, j], out, between, a2)
            b_sum += part * (sent[24, i, j] + sent[23, i, j] * lobe)
    return r_sum, g_sum, b_sum


@_part
def _around(sent, window, hole, p, n, v, s, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the light of a window of facets (top, bottom, left, right) without a hole."""
    r_sum, g_sum, b_sum = _0, _0, _0
    for i in range(max(window[0], 0), min(window[1], sent.shape[1])):
        left, right = max(window[2], 0), min(window[3], sent.shape[2])
        beside = hole[0] <= i < hole[1]
        end = min(max(hole[2], left), right) if beside else right
        r, g, b = _gather(sent, i, left, end, p, n, v, s, gloss)
        r_sum, g_sum, b_sum = r_sum + r, g_sum + g, b_sum + b
        if beside:
            r, g, b = _gather(sent, i, max(hole[3], left), right, p, n, v, s, gloss)
            r_sum, g_sum, b_sum = r_sum + r, g_sum + g, b_sum + b
    return r_sum, g_sum, b_sum


@_part
def _window(row, column):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the larger facets next to a point's own: top, bottom, left, right."""
    return row - NEAR, row + NEAR + 1, column - NEAR, column + NEAR + 1


@_part
def _returned_share(up, index2):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the share of light that the lower face returns, with cosine `up` to its normal."""
    out2 = _1 - index2 * (_1 - up * up)
    out = sqrt(out2 if out2 > _0 else _0)
    index = sqrt(index2)
    across = (index * up - out) / (index * up + out)
    along = (index * out - up) / (index * out + up)
    return _HALF * (across * across + along * along)


@_part
def _returned(sent, index2, p, n, v, s, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the light that a point receives from the mirror images of the facets."""
    r_sum, g_sum, b_sum = _0, _0, _0
    for i in range(sent.shape[1]):
        for j in range(sent.shape[2]):
            dx, dy, dz = sent[0, i, j] - p[0], sent[1, i, j] - p[1], sent[2, i, j] - p[2]
            share = _returned_share(-dz / sqrt(dx * dx + dy * dy + dz * dz), index2)
            r, g, b = _gather(sent, i, j, j + 1, p, n, v, s, gloss)
            r_sum, g_sum, b_sum = r_sum + share * r, g_sum + share * g, b_sum + share * b
    return r_sum, g_sum, b_sum


@_whole
def gather_rows(first, last, at, fields, gloss, index2, result):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Gather the light of the points `first` to `last`.

    Parameters
    ----------
    at : (points, 11) float32
        Point, normal, view, and its row and column among the facets of the field.
    fields : 4 of (planes, rows, columns) float32
        Facets, wide and widest facets of the whole field, from :func:`facets`, and the widest
        ones' mirror images in the lower face.
    gloss : (float, float) or None
        Share and squared roughness of the lobe.
    index2 : float
        Square of the elastomer's refractive index; 0 where no face returns light.
    result : (points, 3) float32
        Written: light to the camera, in the facets' unit.
    """
    near, middle, far, mirrored = fields
    everywhere = (0, far.shape[1], 0, far.shape[2])
    for m in range(first, last):
        p, n = (at[m, 0], at[m, 1], at[m, 2]), (at[m, 3], at[m, 4], at[m, 5])
        v = (at[m, 6], at[m, 7], at[m, 8])
        s = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
        s = s if s > _LEAST_VIEW else _LEAST_VIEW
        row, column = int(at[m, 9]), int(at[m, 10])
        a = _window(row // WIDE, column // WIDE)
        b = _window(row // WIDE**2, column // WIDE**2)
        own = (a[0] * WIDE, a[1] * WIDE, a[2] * WIDE, a[3] * WIDE)
        mid = (b[0] * WIDE, b[1] * WIDE, b[2] * WIDE, b[3] * WIDE)
        r0, g0, b0 = _around(near, own, (0, 0, 0, 0), p, n, v, s, gloss)
        r1, g1, b1 = _around(middle, mid, a, p, n, v, s, gloss)
        r2, g2, b2 = _around(far, everywhere, b, p, n, v, s, gloss)
        r0, g0, b0 = r0 + r1 + r2, g0 + g1 + g2, b0 + b1 + b2
        if index2 > _0:
            r1, g1, b1 = _returned(mirrored, index2, p, n, v, s, gloss)
            r0, g0, b0 = r0 + r1, g0 + g1, b0 + b1
        result[m, 0], result[m, 1], result[m, 2] = r0, g0, b0
