"""Normals of the membrane from one picture: the paper's model (Eq. 10), in one fused pass.

Resampling, division by light and factor, the reflectance table and the 3x3 solve are done pixel
by pixel, so that each byte of the picture is read once. Lights are frozen at the flat membrane.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.poisson import SLOPE_LIMIT

Map = NDArray[np.float32]
SATURATED = 0.995
DARK_COSINE = 0.03


_OUTSIDE = int(Flag.OUTSIDE)
_SATURATED = int(Flag.SATURATED)
_DARK = int(Flag.DARK)
_EXTRAPOLATED = int(Flag.EXTRAPOLATED)
_NOT_OBSERVABLE = int(Flag.NOT_OBSERVABLE)
_INVALID = int(Flag.INVALID)


@dataclass(frozen=True, slots=True)
class ShadingMaps:
    """What the pass needs of a calibration, as float32 arrays.

    Attributes
    ----------
    u_px, v_px : (rows, columns)
        Raw pixel of each node; negative where it is not seen.
    gain : (rows, columns, 3)
        1 / (rho |L|); 0 where the node is of no use.
    lookup : (3, size)
        R sampled evenly (Eq. 7).
    lookup_scale : (3,)
        Processed value to place in `lookup`.
    coverage : (3, 2)
        Cosines that the table has data for.
    leds_mm : (3, 3)
        LED positions, sensor frame.
    x_mm, y_mm : (columns,), (rows,)
        Node positions, sensor frame.
    """

    u_px: Map
    v_px: Map
    gain: Map
    lookup: Map
    lookup_scale: Map
    coverage: Map
    leds_mm: Map
    x_mm: Map
    y_mm: Map


@dataclass(frozen=True, slots=True)
class SlopeField:
    """Slopes of the depth, with what is to be said of each node.

    Attributes
    ----------
    slope_x, slope_y : (rows, columns) float32
        d(depth)/dx and d(depth)/dy.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    length_error : (rows, columns) float32
        | |n| - 1 | of the solved normal, a check that costs nothing; 0 outside.
    """

    slope_x: Map
    slope_y: Map
    flags: NDArray[np.uint8]
    length_error: Map


def solve_slopes(raw: NDArray[Any], maps: ShadingMaps, *, workers: int = 1) -> SlopeField:
    """Solve Eq. (10) for every node and return the slopes of the depth.

    Parameters
    ----------
    raw : (height, width, 3) uint8, uint16 or float32
        Raw picture in RGB order; float pictures are 0..1.
    maps : ShadingMaps
        The calibration.
    workers : int, optional
        Threads; each takes a block of rows, so that the result does not depend on their number.
    """
    shape = maps.u_px.shape
    slope_x, slope_y, length = (np.zeros(shape, dtype=np.float32) for _ in range(3))
    flags = np.zeros(shape, dtype=np.uint8)
    full_scale = np.float32(1.0 if raw.dtype.kind == "f" else np.iinfo(raw.dtype).max)
    raw = np.ascontiguousarray(raw)

    def solve(rows: slice) -> None:
        _solve(
            raw,
            np.float32(1.0) / full_scale,
            maps.u_px[rows],
            maps.v_px[rows],
            maps.gain[rows],
            maps.lookup,
            maps.lookup_scale,
            maps.coverage,
            maps.leds_mm,
            maps.x_mm,
            maps.y_mm[rows],
            slope_x[rows],
            slope_y[rows],
            flags[rows],
            length[rows],
        )

    edges = np.linspace(0, shape[0], max(workers, 1) + 1).astype(int)
    blocks = [slice(int(a), int(b)) for a, b in pairwise(edges)]
    if len(blocks) == 1:
        solve(blocks[0])
    else:
        with ThreadPoolExecutor(len(blocks)) as pool:
            list(pool.map(solve, blocks))
    return SlopeField(slope_x, slope_y, flags, length)


def normals_from_slopes(slope_x: Map, slope_y: Map) -> Map:
    """Return unit normals (rows, columns, 3) towards the camera (z < 0), sensor frame."""
    normals = np.empty((*slope_x.shape, 3), dtype=np.float32)
    scale = -1.0 / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    normals[..., 0] = slope_x * scale
    normals[..., 1] = slope_y * scale
    normals[..., 2] = scale
    return normals


@numba.njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract"})
def _solve(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    raw,
    step,
    u_px,
    v_px,
    gain,
    lookup,
    lookup_scale,
    coverage,
    leds,
    x_mm,
    y_mm,
    slope_x,
    slope_y,
    flags,
    length,
):
    height, width = raw.shape[0], raw.shape[1]
    last = lookup.shape[1] - 1
    cosine = np.empty(3, np.float32)
    for i in range(u_px.shape[0]):
        for j in range(u_px.shape[1]):
            u, v = u_px[i, j], v_px[i, j]
            if gain[i, j, 0] <= 0.0 or not (u >= 0.0 and v >= 0.0):
                flags[i, j] = _OUTSIDE
                continue
            c, r = int(u), int(v)
            c1, r1 = min(c + 1, width - 1), min(r + 1, height - 1)
            fu, fv = u - np.float32(c), v - np.float32(r)
            flag = 0
            for k in range(3):
                a, b = np.float32(raw[r, c, k]), np.float32(raw[r, c1, k])
                d, e = np.float32(raw[r1, c, k]), np.float32(raw[r1, c1, k])
                top, bottom = a + fu * (b - a), d + fu * (e - d)
                value = (top + fv * (bottom - top)) * step
                if max(max(a, b), max(d, e)) * step >= SATURATED:
                    flag |= _SATURATED
                place = value * gain[i, j, k] * lookup_scale[k]
                if not (place >= 0.0):
                    place = np.float32(0.0)
                    flag |= _INVALID
                if place >= last:
                    cosine[k] = lookup[k, last]
                    if place > last:
                        flag |= _EXTRAPOLATED
                else:
                    n = int(place)
                    cosine[k] = lookup[k, n] + (place - np.float32(n)) * (
                        lookup[k, n + 1] - lookup[k, n]
                    )
                if cosine[k] < DARK_COSINE:
                    flag |= _DARK
                elif cosine[k] < coverage[k, 0] or cosine[k] > coverage[k, 1]:
                    flag |= _EXTRAPOLATED
            nx, ny, nz = _normal(cosine, leds, x_mm[j], y_mm[i])
            size = np.sqrt(nx * nx + ny * ny + nz * nz)
            length[i, j] = abs(size - np.float32(1.0))
            least = size / np.float32(SLOPE_LIMIT)
            if not (nz < -least):
                flag |= _NOT_OBSERVABLE
                nz = -least
            if size > 0.0:
                slope_x[i, j] = nx / nz
                slope_y[i, j] = ny / nz
            else:
                flag |= _INVALID
            flags[i, j] = flag


@numba.njit(cache=True, nogil=True, inline="always")
def _normal(cosine, leds, x, y):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Solve [l1; l2; l3] n = c by cross products; l_k point from (x, y, 0) to the LEDs."""
    ax, ay, az = leds[0, 0] - x, leds[0, 1] - y, leds[0, 2]
    bx, by, bz = leds[1, 0] - x, leds[1, 1] - y, leds[1, 2]
    cx, cy, cz = leds[2, 0] - x, leds[2, 1] - y, leds[2, 2]
    ca = cosine[0] * np.sqrt(ax * ax + ay * ay + az * az)
    cb = cosine[1] * np.sqrt(bx * bx + by * by + bz * bz)
    cc = cosine[2] * np.sqrt(cx * cx + cy * cy + cz * cz)
    px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    inverse = np.float32(1.0) / (ax * px + ay * py + az * pz)
    return (
        (ca * px + cb * qx + cc * rx) * inverse,
        (ca * py + cb * qy + cc * ry) * inverse,
        (ca * pz + cb * qz + cc * rz) * inverse,
    )
