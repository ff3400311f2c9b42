"""The compiled part of the near-light solve: one normal for each node of a block of rows.

Helpers take and give plain numbers: handed arrays, the loop would take half as long again.
"""

from __future__ import annotations

from math import pi, sqrt

import numba
import numpy as np

from gelpolight_core.reconstruction.height_map import Flag

DARK_SIGMAS = 4.0
# A channel with more than this share of the flat membrane's light is not dark, however noisy it is.
DARK_SHARE = 0.15
STEEPEST_NZ = 0.15
LEAST_ALONG_RAY = 0.1
ONE_DARK_WEIGHT = 0.5
UNSOLVED_WEIGHT = 0.003
# What the model does not explain of press over background; it, not noise, limits a good image.
MODEL_ERROR = 0.03

_compiled = numba.njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract"})
_OUTSIDE = int(Flag.OUTSIDE)
_SATURATED = int(Flag.SATURATED)
_DARK = int(Flag.DARK)
_NOT_OBSERVABLE = int(Flag.NOT_OBSERVABLE)


@_compiled
def _response(lx, ly, lz, nx, ny, nz, vx, vy, vz, shape, curves, k):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the membrane's brightness under one light; as Membrane.response."""
    facing = lx * nx + ly * ny + lz * nz
    if facing <= 0.0:
        return 0.0
    cosine = max(facing, 1e-3)
    if curves is None:
        diffuse = cosine ** shape[0]
    else:
        place = min(cosine, 1.0) * (curves.shape[1] - 1)
        below = min(int(place), curves.shape[1] - 2)
        diffuse = curves[k, below] + (place - below) * (curves[k, below + 1] - curves[k, below])
    value = (1.0 - shape[1]) * diffuse / pi
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


@_compiled
def _limit(nx, ny, nz):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the normal at unit length and not steeper than can be seen."""
    size = sqrt(nx * nx + ny * ny + nz * nz)
    if size < 1e-12:  # all channels black: no light tells of a slope
        return 0.0, 0.0, -1.0
    nx, ny, nz = nx / size, ny / size, nz / size
    if nz > -STEEPEST_NZ:
        level = sqrt(nx * nx + ny * ny)
        stretch = sqrt(1.0 - STEEPEST_NZ * STEEPEST_NZ) / max(level, 1e-12)
        return nx * stretch, ny * stretch, -STEEPEST_NZ
    return nx, ny, nz


@_compiled
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


@_compiled
def _near(led_x, led_y, led_z, x, y, d, wx, wy):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return a light's direction at the present depth and on the flat, and what it gains by it.

    The gain is that of lobe and inverse square (PHYSICS, shading).
    """
    ax, ay, az = led_x - x - d * wx, led_y - y - d * wy, led_z + d
    r = sqrt(ax * ax + ay * ay + az * az)
    fx, fy, fz = led_x - x, led_y - y, led_z
    r0 = sqrt(fx * fx + fy * fy + fz * fz)
    gain = (az / r) / (fz / r0) * (r0 / r) ** 2
    return ax / r, ay / r, az / r, fx / r0, fy / r0, fz / r0, gain


@_compiled
def _tangents(nx, ny, nz):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return two unit directions across a normal."""
    if abs(nx) < 0.7:
        tx, ty, tz = 0.0, nz, -ny
    else:
        tx, ty, tz = -nz, 0.0, nx
    size = sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / size, ty / size, tz / size
    return tx, ty, tz, ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx


@_compiled
def _step(c11, c12, c22, g1, g2):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return the Gauss-Newton step along the two tangents, held to 0.3, and its full length."""
    damp = 1e-6 * (c11 + c22) + 1e-12
    det = (c11 + damp) * (c22 + damp) - c12 * c12
    m1 = ((c22 + damp) * g1 - c12 * g2) / det
    m2 = ((c11 + damp) * g2 - c12 * g1) / det
    move = sqrt(m1 * m1 + m2 * m2)
    if move > 0.3:
        m1, m2 = m1 * 0.3 / move, m2 * 0.3 / move
    return m1, m2, move


@_compiled
def _trust(nz, along, missing_count):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return a node's weight, and its flag where the camera cannot see the wall."""
    if nz > -STEEPEST_NZ - 1e-6 or along < LEAST_ALONG_RAY:
        return UNSOLVED_WEIGHT, _NOT_OBSERVABLE
    if missing_count >= 2:
        return UNSOLVED_WEIGHT, 0
    return (ONE_DARK_WEIGHT if missing_count == 1 else 1.0), 0


@_compiled
def solve_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first,
    last,
    ratio,
    sigma,
    around,
    saturated,
    usable,
    inside,
    ray_slope,
    x_mm,
    y_mm,
    depth,
    leds,
    shape,
    curves,
    dark,
    shadows,
    slope_x,
    slope_y,
    normals,
    weight,
    flags,
):
    """Solve the nodes of rows `first` to `last`; see `solve_near_light` for what is what."""
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
            wx, wy = ray_slope[i, j, 0], ray_slope[i, j, 1]
            back = sqrt(wx * wx + wy * wy + 1.0)
            vx, vy, vz = wx / back, wy / back, -1.0 / back
            for k in range(3):
                light[k, 0], light[k, 1], light[k, 2], fx, fy, fz, gain = _near(
                    leds[k, 0], leds[k, 1], leds[k, 2], x, y, d, wx, wy
                )
                flat = _response(fx, fy, fz, 0.0, 0.0, -1.0, vx, vy, vz, shape, curves, k)
                scale[k] = flat / gain
            nx, ny, nz = 0.0, 0.0, -1.0
            missing_count = 0
            flag = 0
            for step in range(8):
                missing_count, missing, side = 0, -1, 0
                for k in range(3):
                    direct[k] = (ratio[i, j, k] - around[i, j, k]) * scale[k]
                    spread[k] = sqrt(sigma[i, j, k] ** 2 + MODEL_ERROR**2) * scale[k]
                    low = max(dark[k], min(DARK_SIGMAS * sigma[i, j, k], DARK_SHARE) * scale[k])
                    out[k] = 0
                    if saturated[i, j, k]:
                        out[k], missing, side = 1, k, 1
                    elif shadows and not (direct[k] >= low):
                        out[k], missing, side = -1, k, -1
                    if out[k] != 0:
                        missing_count += 1
                if missing_count >= 2:
                    break
                if step == 0:
                    for k in range(3):
                        lit = light[k, 0] * nx + light[k, 1] * ny + light[k, 2] * nz
                        lx, ly, lz = light[k, 0], light[k, 1], light[k, 2]
                        flat = _response(lx, ly, lz, nx, ny, nz, vx, vy, vz, shape, curves, k)
                        value[k] = min(lit * max(direct[k], 0.0) / max(flat, 1e-6), 1.0)
                    nx, ny, nz = _start(light, value, side, missing)
                    nx, ny, nz = _limit(nx, ny, nz)
                    continue
                tx, ty, tz, sx, sy, sz = _tangents(nx, ny, nz)
                c11, c12, c22, g1, g2 = 0.0, 0.0, 0.0, 0.0, 0.0
                e = 1e-4
                for k in range(3):
                    if out[k] != 0:
                        continue
                    lx, ly, lz = light[k, 0], light[k, 1], light[k, 2]
                    f = _response(lx, ly, lz, nx, ny, nz, vx, vy, vz, shape, curves, k)
                    f1 = _response(
                        lx,
                        ly,
                        lz,
                        nx + e * tx,
                        ny + e * ty,
                        nz + e * tz,
                        vx,
                        vy,
                        vz,
                        shape,
                        curves,
                        k,
                    )
                    f2 = _response(
                        lx,
                        ly,
                        lz,
                        nx + e * sx,
                        ny + e * sy,
                        nz + e * sz,
                        vx,
                        vy,
                        vz,
                        shape,
                        curves,
                        k,
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
                m1, m2, move = _step(c11, c12, c22, g1, g2)
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
            if missing_count >= 2:
                nx, ny, nz = 0.0, 0.0, -1.0
            along = nx * wx + ny * wy - nz
            weight[i, j], hidden = _trust(nz, along, missing_count)
            along = max(along, LEAST_ALONG_RAY)
            normals[i, j, 0], normals[i, j, 1], normals[i, j, 2] = nx, ny, nz
            # d_u = - n . (P0_u + d w_u) / (n . w): the surface point moves along its own ray.
            j0, j1, i0, i1 = (
                max(j - 1, 0),
                min(j + 1, columns - 1),
                max(i - 1, 0),
                min(i + 1, rows - 1),
            )
            px, py = x_mm[j1] - x_mm[j0], y_mm[i1] - y_mm[i0]
            wxx = (ray_slope[i, j1, 0] - ray_slope[i, j0, 0]) / px
            wyx = (ray_slope[i, j1, 1] - ray_slope[i, j0, 1]) / px
            wxy = (ray_slope[i1, j, 0] - ray_slope[i0, j, 0]) / py
            wyy = (ray_slope[i1, j, 1] - ray_slope[i0, j, 1]) / py
            slope_x[i, j] = -(nx * (1.0 + d * wxx) + ny * d * wyx) / along
            slope_y[i, j] = -(nx * d * wxy + ny * (1.0 + d * wyy)) / along
            flags[i, j] = flag | hidden
