"""Normals by the full model: near light, gloss, light from the surroundings, and shadows.

For every node the surface point is placed along its refracted ray at the present depth; light
directions, inverse square and lobe are those at that place. Press over background is compared with
the membrane's response, and the normal is found by Gauss-Newton steps on the unit sphere. A dark or
saturated channel is missing information: it is left out, and the two that remain decide together
with |n| = 1. Of their two solutions the one that keeps the dark light dark is started from.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt

import numba
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reflectance.membrane import Membrane

Map = NDArray[np.float32]
DARK_COSINE = 0.03
DARK_SIGMAS = 4.0
STEEPEST_NZ = 0.15
LEAST_ALONG_RAY = 0.1
ONE_DARK_WEIGHT = 0.5
UNSOLVED_WEIGHT = 0.01
# What the model does not explain of press over background; it, not noise, limits a good picture.
MODEL_ERROR = 0.03

_OUTSIDE = int(Flag.OUTSIDE)
_SATURATED = int(Flag.SATURATED)
_DARK = int(Flag.DARK)
_NOT_OBSERVABLE = int(Flag.NOT_OBSERVABLE)


@dataclass(frozen=True, slots=True)
class ShadedField:
    """What one scale of the solve works on, all (rows, columns, ...) on one grid.

    Attributes
    ----------
    ratio, sigma, around : (rows, columns, 3) float32
        Press over background, its standard deviation, and its average in the neighbourhood.
    saturated : (rows, columns, 3) bool
        Channels that are saturated.
    usable : (rows, columns) bool
        Nodes with light and membrane.
    inside : (rows, columns) bool
        Nodes within the seen part of the working circle; where they are not usable, the depth is
        led by what is around.
    drift : (rows, columns, 2) float32
        Sideways move of the ray per mm of depth.
    x_mm, y_mm : (columns,), (rows,) float64
        Nodes.
    """

    ratio: Map
    sigma: Map
    around: Map
    saturated: NDArray[np.bool_]
    usable: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    drift: Map
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RaySlopes:
    """Slopes along the picture's rays, as the ray-true integration wants them.

    Attributes
    ----------
    slope_x, slope_y : (rows, columns) float32
        Change of the depth from node to node, per mm.
    normals : (rows, columns, 3) float32
        Unit normals of the surface, z < 0.
    weight : (rows, columns) float32
        How far the slopes are to be trusted, 0..1.
    slope_sd : (rows, columns) float32
        Standard deviation of the slopes from the picture's noise.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    """

    slope_x: Map
    slope_y: Map
    normals: Map
    weight: Map
    slope_sd: Map
    flags: NDArray[np.uint8]


def solve_near_light(
    field: ShadedField,
    depth_mm: Map,
    led_positions_mm: NDArray[np.float64],
    membrane: Membrane,
    *,
    shadows: bool = True,
    workers: int = 1,
) -> RaySlopes:
    """Solve every node's normal at the present depth.

    Parameters
    ----------
    field : ShadedField
        The picture on the grid.
    depth_mm : (rows, columns) float32
        Present depth at each node's ray.
    led_positions_mm : (3, 3)
        Sensor frame.
    membrane : Membrane
        Its response.
    shadows : bool, optional
        Whether a dark channel is missing information; else its value is believed.
    workers : int, optional
        Threads; each takes a block of rows, so that the result does not depend on their number.
    """
    shape = depth_mm.shape
    slope_x, slope_y, weight, slope_sd = (np.zeros(shape, np.float32) for _ in range(4))
    normals = np.zeros((*shape, 3), np.float32)
    flags = np.zeros(shape, np.uint8)
    shape_of = np.array(
        [membrane.exponent, membrane.gloss, membrane.roughness, membrane.bounce], np.float64
    )
    depth = np.ascontiguousarray(depth_mm, np.float32)
    leds = np.ascontiguousarray(led_positions_mm, np.float64)

    def solve(rows: tuple[int, int]) -> None:
        _solve_all(
            rows[0],
            rows[1],
            field.ratio,
            field.sigma,
            field.around,
            field.saturated,
            field.usable,
            field.inside,
            field.drift,
            field.x_mm,
            field.y_mm,
            depth,
            leds,
            shape_of,
            shadows,
            slope_x,
            slope_y,
            normals,
            weight,
            slope_sd,
            flags,
        )

    # More blocks than threads: rows without contact are done sooner.
    edges = np.linspace(0, shape[0], 8 * max(workers, 1) + 1).astype(int).tolist()
    with ThreadPoolExecutor(max(workers, 1)) as pool:
        list(pool.map(solve, pairwise(edges)))
    return RaySlopes(slope_x, slope_y, normals, weight, slope_sd, flags)


@numba.njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract"})
def _response(lx, ly, lz, nx, ny, nz, vx, vy, vz, shape):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the membrane's brightness under one light; as Membrane.response."""
    facing = lx * nx + ly * ny + lz * nz
    if facing <= 0.0:
        return 0.0
    cosine = max(facing, 1e-3)
    value = (1.0 - shape[1]) * cosine ** shape[0] / pi
    if shape[1] > 0.0:
        hx, hy, hz = lx + vx, ly + vy, lz + vz
        tilt = max((hx * nx + hy * ny + hz * nz) / sqrt(hx * hx + hy * hy + hz * hz), 0.0)
        seen = max(vx * nx + vy * ny + vz * nz, 1e-2)
        a2 = shape[2] * shape[2]
        facets = a2 / (pi * (tilt * tilt * (a2 - 1.0) + 1.0) ** 2)
        lit = 2.0 * cosine / (cosine + sqrt(a2 + (1.0 - a2) * cosine * cosine))
        shown = 2.0 * seen / (seen + sqrt(a2 + (1.0 - a2) * seen * seen))
        value += shape[1] * facets * lit * shown / (4.0 * seen)
    return value


@numba.njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract"})
def _limit(nx, ny, nz):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the normal at unit length and not steeper than can be seen."""
    size = sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / size, ny / size, nz / size
    if nz > -STEEPEST_NZ:
        level = sqrt(nx * nx + ny * ny)
        stretch = sqrt(1.0 - STEEPEST_NZ * STEEPEST_NZ) / max(level, 1e-12)
        return nx * stretch, ny * stretch, -STEEPEST_NZ
    return nx, ny, nz


@numba.njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract"})
def _start(light, value, known, missing):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return a first normal from equivalent cosines: three lights, or two and |n| = 1.

    `missing` is the light left out (-1: none); `known` says on which side of it the surface lies:
    -1 turned away (dark), +1 turned towards it (saturated).
    """
    a, b, c = light[0], light[1], light[2]
    if missing < 0:
        px, py, pz = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
        qx, qy, qz = c[1] * a[2] - c[2] * a[1], c[2] * a[0] - c[0] * a[2], c[0] * a[1] - c[1] * a[0]
        rx, ry, rz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        det = a[0] * px + a[1] * py + a[2] * pz
        return (
            (value[0] * px + value[1] * qx + value[2] * rx) / det,
            (value[0] * py + value[1] * qy + value[2] * ry) / det,
            (value[0] * pz + value[1] * qz + value[2] * rz) / det,
        )
    u, v = (missing + 1) % 3, (missing + 2) % 3
    a, b, c = light[u], light[v], light[missing]
    ex, ey, ez = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    between = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    det = 1.0 - between * between
    along_a = (value[u] - between * value[v]) / det
    along_b = (value[v] - between * value[u]) / det
    bx = along_a * a[0] + along_b * b[0]
    by = along_a * a[1] + along_b * b[1]
    bz = along_a * a[2] + along_b * b[2]
    left = (1.0 - bx * bx - by * by - bz * bz) / (ex * ex + ey * ey + ez * ez)
    step = sqrt(max(left, 1e-4))
    if (ex * c[0] + ey * c[1] + ez * c[2] > 0.0) != (known > 0):
        step = -step
    return bx + step * ex, by + step * ey, bz + step * ez


@numba.njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract"})
def _solve_all(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first,
    last,
    ratio,
    sigma,
    around,
    saturated,
    usable,
    inside,
    drift,
    x_mm,
    y_mm,
    depth,
    leds,
    shape,
    shadows,
    slope_x,
    slope_y,
    normals,
    weight,
    slope_sd,
    flags,
):
    rows, columns = depth.shape
    light = np.empty((3, 3))
    scale, direct, value, spread = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    out = np.zeros(3, np.int64)
    for i in range(first, last):
        for j in range(columns):
            normals[i, j, 2] = -1.0
            if not usable[i, j]:
                flags[i, j] = _OUTSIDE
                weight[i, j] = UNSOLVED_WEIGHT if inside[i, j] else 1.0
                continue
            x, y, d = x_mm[j], y_mm[i], depth[i, j]
            wx, wy = drift[i, j, 0], drift[i, j, 1]
            back = sqrt(wx * wx + wy * wy + 1.0)
            vx, vy, vz = wx / back, wy / back, -1.0 / back
            for k in range(3):
                ax, ay = leds[k, 0] - x - d * wx, leds[k, 1] - y - d * wy
                az = leds[k, 2] + d
                r = sqrt(ax * ax + ay * ay + az * az)
                fx, fy, fz = leds[k, 0] - x, leds[k, 1] - y, leds[k, 2]
                r0 = sqrt(fx * fx + fy * fy + fz * fz)
                light[k, 0], light[k, 1], light[k, 2] = ax / r, ay / r, az / r
                flat = _response(fx / r0, fy / r0, fz / r0, 0.0, 0.0, -1.0, vx, vy, vz, shape)
                # Near light: lobe and inverse square at the present depth (PHYSICS, shading).
                scale[k] = flat / ((az / r) / (fz / r0) * (r0 / r) ** 2)
            nx, ny, nz = 0.0, 0.0, -1.0
            missing_count = 0
            flag = 0
            c11, c12, c22 = 1.0, 0.0, 1.0
            for step in range(8):
                missing_count, missing, side = 0, -1, 0
                for k in range(3):
                    bounce = shape[3] * around[i, j, k] * 0.5 * (1.0 + nz)
                    direct[k] = (ratio[i, j, k] - bounce) * scale[k]
                    spread[k] = sqrt(sigma[i, j, k] ** 2 + MODEL_ERROR**2) * scale[k]
                    dark = DARK_COSINE * (1.0 - shape[1]) / pi
                    dark = max(dark, DARK_SIGMAS * sigma[i, j, k] * scale[k])
                    out[k] = 0
                    if saturated[i, j, k]:
                        out[k], missing, side = 1, k, 1
                    elif shadows and not (direct[k] >= dark):
                        out[k], missing, side = -1, k, -1
                    if out[k] != 0:
                        missing_count += 1
                if missing_count >= 2:
                    break
                if step == 0:
                    for k in range(3):
                        lit = light[k, 0] * nx + light[k, 1] * ny + light[k, 2] * nz
                        lx, ly, lz = light[k, 0], light[k, 1], light[k, 2]
                        flat = _response(lx, ly, lz, nx, ny, nz, vx, vy, vz, shape)
                        value[k] = min(lit * max(direct[k], 0.0) / max(flat, 1e-6), 1.0)
                    nx, ny, nz = _start(light, value, side, missing)
                    nx, ny, nz = _limit(nx, ny, nz)
                    continue
                # Two tangent directions at n; residuals and slopes along them.
                if abs(nx) < 0.7:
                    tx, ty, tz = 0.0, nz, -ny
                else:
                    tx, ty, tz = -nz, 0.0, nx
                size = sqrt(tx * tx + ty * ty + tz * tz)
                tx, ty, tz = tx / size, ty / size, tz / size
                sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
                c11, c12, c22, g1, g2 = 0.0, 0.0, 0.0, 0.0, 0.0
                e = 1e-4
                for k in range(3):
                    if out[k] != 0:
                        continue
                    lx, ly, lz = light[k, 0], light[k, 1], light[k, 2]
                    f = _response(lx, ly, lz, nx, ny, nz, vx, vy, vz, shape)
                    f1 = _response(
                        lx, ly, lz, nx + e * tx, ny + e * ty, nz + e * tz, vx, vy, vz, shape
                    )
                    f2 = _response(
                        lx, ly, lz, nx + e * sx, ny + e * sy, nz + e * sz, vx, vy, vz, shape
                    )
                    bend = 0.5 * shape[3] * around[i, j, k] * scale[k]
                    d1, d2 = (f1 - f) / e + bend * tz, (f2 - f) / e + bend * sz
                    w = 1.0 / (spread[k] * spread[k])
                    error = direct[k] - f
                    c11 += w * d1 * d1
                    c12 += w * d1 * d2
                    c22 += w * d2 * d2
                    g1 += w * d1 * error
                    g2 += w * d2 * error
                damp = 1e-6 * (c11 + c22) + 1e-12
                det = (c11 + damp) * (c22 + damp) - c12 * c12
                m1 = ((c22 + damp) * g1 - c12 * g2) / det
                m2 = ((c11 + damp) * g2 - c12 * g1) / det
                move = sqrt(m1 * m1 + m2 * m2)
                if move > 0.3:
                    m1, m2 = m1 * 0.3 / move, m2 * 0.3 / move
                nx, ny, nz = _limit(
                    nx + m1 * tx + m2 * sx, ny + m1 * ty + m2 * sy, nz + m1 * tz + m2 * sz
                )
                if move < 5e-4:  # the next step's move would be its square
                    break
            for k in range(3):
                if out[k] < 0:
                    flag |= _DARK
                elif out[k] > 0:
                    flag |= _SATURATED
            trust = 1.0
            if missing_count == 1:
                trust = ONE_DARK_WEIGHT
            elif missing_count >= 2:
                trust = UNSOLVED_WEIGHT
                nx, ny, nz = 0.0, 0.0, -1.0
                c11, c12, c22 = 1.0, 0.0, 1.0
            if nz > -STEEPEST_NZ - 1e-6:
                trust = UNSOLVED_WEIGHT
                flag |= _NOT_OBSERVABLE
            along = nx * wx + ny * wy - nz
            if along < LEAST_ALONG_RAY:
                along = LEAST_ALONG_RAY
                trust = UNSOLVED_WEIGHT
                flag |= _NOT_OBSERVABLE
            normals[i, j, 0], normals[i, j, 1], normals[i, j, 2] = nx, ny, nz
            # d_u = - n . (P0_u + d w_u) / (n . w): the surface point moves along its own ray.
            j0, j1, i0, i1 = (
                max(j - 1, 0),
                min(j + 1, columns - 1),
                max(i - 1, 0),
                min(i + 1, rows - 1),
            )
            px, py = x_mm[j1] - x_mm[j0], y_mm[i1] - y_mm[i0]
            wxx = (drift[i, j1, 0] - drift[i, j0, 0]) / px
            wyx = (drift[i, j1, 1] - drift[i, j0, 1]) / px
            wxy = (drift[i1, j, 0] - drift[i0, j, 0]) / py
            wyy = (drift[i1, j, 1] - drift[i0, j, 1]) / py
            slope_x[i, j] = -(nx * (1.0 + d * wxx) + ny * d * wyx) / along
            slope_y[i, j] = -(nx * d * wxy + ny * (1.0 + d * wyy)) / along
            weight[i, j] = trust
            det = max(c11 * c22 - c12 * c12, 1e-12)
            slope_sd[i, j] = sqrt(0.5 * (c11 + c22) / det) / (nz * nz)
            flags[i, j] = flag
