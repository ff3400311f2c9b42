"""The compiled part of the planned near-light solve: blocks of nodes, many at a time.

The same mathematics as `near_light_kernel`, without branches and in single precision, so that the
processor solves eight or sixteen nodes at once. Every block is copied into one small array: handed
twenty arrays, the compiler could not know that none overlaps another.
"""

from __future__ import annotations

from math import pi, sqrt

import numba
import numpy as np

from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.near_light_kernel import (
    DARK_SHARE,
    DARK_SIGMAS,
    LEAST_ALONG_RAY,
    MODEL_ERROR,
    ONE_DARK_WEIGHT,
    STEEPEST_NZ,
    UNSOLVED_WEIGHT,
)

_B = 64
# Planes of a block's array: what is read, what is worked with, and what is written.
_RATIO, _SCALE, _NOISE, _AROUND, _DEPTH, _SATURATED, _KIND = 0, 3, 6, 9, 12, 13, 16
_SCALED, _NORMAL, _LIGHT, _VIEW, _SLOPE = 17, 20, 23, 32, 35
_TRUST, _FLAG, _MOVED, _PLANES = 37, 38, 39, 40
# Steps are done until the longest of a block is shorter than so much.
MOST_STEPS = 4
SETTLED = 3e-3
_single = np.float32
_0, _1, _HALF = _single(0.0), _single(1.0), _single(0.5)
_PI = _single(pi)
_LEAST_COSINE, _LEAST_VIEW = _single(1e-3), _single(1e-2)
_STEEPEST = _single(STEEPEST_NZ)
_LEVEL = _single(sqrt(1.0 - STEEPEST_NZ**2))
_LEAST_ALONG = _single(LEAST_ALONG_RAY)
_ONE_DARK, _UNSOLVED = _single(ONE_DARK_WEIGHT), _single(UNSOLVED_WEIGHT)
_MODEL2 = _single(MODEL_ERROR**2)
_SIGMAS, _SHARE = _single(DARK_SIGMAS), _single(DARK_SHARE)
_LONGEST = _single(0.3)
_DAMP, _TINY = _single(1e-6), _single(1e-12)
_SETTLED = _single(SETTLED**2)
_F_OUTSIDE, _F_SATURATED = _single(Flag.OUTSIDE), _single(Flag.SATURATED)
_F_DARK, _F_HIDDEN = _single(Flag.DARK), _single(Flag.NOT_OBSERVABLE)

_part = numba.njit(nogil=True, fastmath=True, error_model="numpy", forceinline=True, cache=True)
_whole = numba.njit(nogil=True, fastmath=True, error_model="numpy", cache=True)


@_part
def _most(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a if a > b else b


@_part
def _least(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a if a < b else b


@_part
def _curve(c, p):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the diffuse share's polynomial and its derivative."""
    v = p[7]
    s = v
    v = v * c + p[6]
    s = s * c + v
    v = v * c + p[5]
    s = s * c + v
    v = v * c + p[4]
    s = s * c + v
    v = v * c + p[3]
    s = s * c + v
    v = v * c + p[2]
    s = s * c + v
    v = v * c + p[1]
    s = s * c + v
    return v * c + p[0], s


@_part
def _response(l, n, v, p, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled # noqa: E741
    """Return the brightness under one light, and its gradient by the (free) normal."""
    facing = l[0] * n[0] + l[1] * n[1] + l[2] * n[2]
    c = _most(facing, _LEAST_COSINE)
    f, by_c = _curve(_least(c, _1), p)
    if gloss is None:
        on = _1 if facing > _0 else _0
        return f * on, by_c * l[0] * on, by_c * l[1] * on, by_c * l[2] * on
    share, a2 = gloss
    hx, hy, hz = l[0] + v[0], l[1] + v[1], l[2] + v[2]
    short = _1 / sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx * short, hy * short, hz * short
    t = _most(hx * n[0] + hy * n[1] + hz * n[2], _0)
    s = _most(v[0] * n[0] + v[1] * n[1] + v[2] * n[2], _LEAST_VIEW)
    b2 = _1 - a2
    width = _1 / (_1 - t * t * b2)
    rc = sqrt(a2 + b2 * c * c)
    rs = sqrt(a2 + b2 * s * s)
    lit = _1 / (c + rc)
    shown = _1 / (s + rs)
    # D(t) * 2c / (c + rc) * 2s / (s + rs) / (4 s)
    lobe = share * a2 / _PI * width * width * lit * shown
    g = lobe * c
    on = _1 if facing > _0 else _0
    by_c = (by_c + lobe * (_1 - c * lit * (_1 + b2 * c / rc))) * on
    by_t = g * _single(4.0) * b2 * t * width * on
    by_s = -g * shown * (_1 + b2 * s / rs) * on
    return (
        (f + g) * on,
        by_c * l[0] + by_t * hx + by_s * v[0],
        by_c * l[1] + by_t * hy + by_s * v[1],
        by_c * l[2] + by_t * hz + by_s * v[2],
    )


@_part
def _limited(nx, ny, nz):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the normal at unit length and not steeper than can be seen."""
    size = _1 / sqrt(nx * nx + ny * ny + nz * nz + _TINY)
    nx, ny, nz = nx * size, ny * size, nz * size
    stretch = _LEVEL / sqrt(nx * nx + ny * ny + _TINY)
    steep = nz > -_STEEPEST
    return (
        nx * stretch if steep else nx,
        ny * stretch if steep else ny,
        -_STEEPEST if steep else nz,
    )


@_part
def _light(led, x, y, d):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a light's direction at the present depth, and r^3 / z of its near-light gain."""
    ax, ay, az = led[0] - x, led[1] - y, led[2] + d
    r2 = ax * ax + ay * ay + az * az
    short = _1 / sqrt(r2)
    return (ax * short, ay * short, az * short), r2 * r2 * short / az


@_part
def _told(ratio, around, sigma, sat, scale, dark, bounce, nz, shadows):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a channel's direct light, and what it says: 1, or 0 where it is dark or saturated."""
    direct = ratio if bounce is None else ratio - bounce * around * _HALF * (_1 + nz)
    direct = direct * scale
    low = _most(dark, _least(_SIGMAS * sigma, _SHARE) * scale)
    lit = _1 if direct >= low else _0
    if not shadows:
        lit = _1
    return direct, lit, _0 if sat > _0 else lit


@_part
def _cross(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_part
def _inner(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_part
def _chosen(first, second, a, b, c):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a where `first`, else b where `second`, else c."""
    x = a[0] if first else (b[0] if second else c[0])
    y = a[1] if first else (b[1] if second else c[1])
    z = a[2] if first else (b[2] if second else c[2])
    return x, y, z


@_part
def _start(l0, l1, l2, e0, e1, e2, w0, w1, w2, lit0, lit1, lit2):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a first normal from equivalent cosines: three lights, or two and |n| = 1."""
    p, q, r = _cross(l1, l2), _cross(l2, l0), _cross(l0, l1)
    short = _1 / _inner(l0, p)
    ax = (e0 * p[0] + e1 * q[0] + e2 * r[0]) * short
    ay = (e0 * p[1] + e1 * q[1] + e2 * r[1]) * short
    az = (e0 * p[2] + e1 * q[2] + e2 * r[2]) * short
    is0, is1 = w0 == _0, w1 == _0
    a, b, c = (
        _chosen(is0, is1, l1, l2, l0),
        _chosen(is0, is1, l2, l0, l1),
        _chosen(is0, is1, l0, l1, l2),
    )
    ea = e1 if is0 else (e2 if is1 else e0)
    eb = e2 if is0 else (e0 if is1 else e1)
    bright = lit0 if is0 else (lit1 if is1 else lit2)
    ex, ey, ez = _chosen(is0, is1, p, q, r)
    between = _inner(a, b)
    det = _1 / (_1 - between * between)
    ka, kb = (ea - between * eb) * det, (eb - between * ea) * det
    bx, by, bz = ka * a[0] + kb * b[0], ka * a[1] + kb * b[1], ka * a[2] + kb * b[2]
    left = (_1 - bx * bx - by * by - bz * bz) / (ex * ex + ey * ey + ez * ez)
    step = sqrt(_most(left, _single(1e-4)))
    # Away from a dark light, towards a saturated one.
    side = ex * c[0] + ey * c[1] + ez * c[2]
    towards = side if bright > _0 else -side
    step = step if towards > _0 else -step
    one = w0 + w1 + w2 < _single(2.5)
    return _limited(
        bx + step * ex if one else ax,
        by + step * ey if one else ay,
        bz + step * ez if one else az,
    )


@_part
def _pull(f, gx, gy, gz, n, direct, scale, sigma, weight, bend):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a channel's part of the Gauss-Newton equations along two tangents of n.

    The tangents are (-nz, 0, nx) and (0, -nz, ny).
    """
    d1 = n[0] * (gz + bend) - n[2] * gx
    d2 = n[1] * (gz + bend) - n[2] * gy
    w = weight / ((sigma * sigma + _MODEL2) * scale * scale)
    e = w * (direct - f)
    return w * d1 * d1, w * d1 * d2, w * d2 * d2, d1 * e, d2 * e


@_part
def _triple(w, first, j):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return w[first * _B + j], w[(first + 1) * _B + j], w[(first + 2) * _B + j]


@_part
def _put(w, first, j, values):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    w[first * _B + j] = values[0]
    w[(first + 1) * _B + j] = values[1]
    w[(first + 2) * _B + j] = values[2]


@_part
def _channels(w, j, dark, bounce, nz, shadows):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return direct light, whether it is lit, and what it says, of a node's three channels."""
    r0, r1, r2 = _triple(w, _RATIO, j)
    a0, a1, a2 = _triple(w, _AROUND, j)
    g0, g1, g2 = _triple(w, _NOISE, j)
    b0, b1, b2 = _triple(w, _SATURATED, j)
    s0, s1, s2 = _triple(w, _SCALED, j)
    return (
        _told(r0, a0, g0, b0, s0, dark[0], bounce, nz, shadows),
        _told(r1, a1, g1, b1, s1, dark[1], bounce, nz, shadows),
        _told(r2, a2, g2, b2, s2, dark[2], bounce, nz, shadows),
    )


@_whole
def _begin_block(w, drift, y, x_first, pitch, leds, dark, curves, gloss, bounce, shadows, warm):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Find lights, view and a first normal of a block's nodes.

    Begun `warm`, the normals that stand there are gone on with where all three lights tell of them.
    """
    flat = (_0, _0, -_1)
    for j in range(_B):
        d, at = w[_DEPTH * _B + j], _single(j)
        wx, wy = drift[0] + at * drift[1], drift[2] + at * drift[3]
        x = x_first + pitch * at + d * wx
        short = _1 / sqrt(wx * wx + wy * wy + _1)
        v = (wx * short, wy * short, -short)
        l0, near0 = _light(leds[0], x, y + d * wy, d)
        l1, near1 = _light(leds[1], x, y + d * wy, d)
        l2, near2 = _light(leds[2], x, y + d * wy, d)
        s0, s1, s2 = _triple(w, _SCALE, j)
        _put(w, _SCALED, j, (s0 * near0, s1 * near1, s2 * near2))
        (d0, _, k0), (d1, _, k1), (d2, _, k2) = _channels(w, j, dark, bounce, -_1, shadows)
        f0 = _response(l0, flat, v, curves[0], gloss)[0]
        f1 = _response(l1, flat, v, curves[1], gloss)[0]
        f2 = _response(l2, flat, v, curves[2], gloss)[0]
        e0 = _least(-l0[2] * _most(d0, _0) / _most(f0, _DAMP), _1)
        e1 = _least(-l1[2] * _most(d1, _0) / _most(f1, _DAMP), _1)
        e2 = _least(-l2[2] * _most(d2, _0) / _most(f2, _DAMP), _1)
        b0, b1, b2 = _triple(w, _SATURATED, j)
        nx, ny, nz = _start(l0, l1, l2, e0, e1, e2, k0, k1, k2, b0, b1, b2)
        px, py = w[_NORMAL * _B + j], w[(_NORMAL + 1) * _B + j]
        on = warm * (k0 + k1 + k2) > _single(2.5)
        pz = -sqrt(_most(_1 - px * px - py * py, _TINY))
        _put(w, _NORMAL, j, (px if on else nx, py if on else ny, pz if on else nz))
        _put(w, _LIGHT, j, l0)
        _put(w, _LIGHT + 3, j, l1)
        _put(w, _LIGHT + 6, j, l2)
        _put(w, _VIEW, j, v)


@_whole
def _step_block(w, dark, curves, gloss, bounce, shadows):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Do one Gauss-Newton step at a block's nodes; return the square of the longest."""
    for j in range(_B):
        n, v = _triple(w, _NORMAL, j), _triple(w, _VIEW, j)
        (t0, _, k0), (t1, _, k1), (t2, _, k2) = _channels(w, j, dark, bounce, n[2], shadows)
        s0, s1, s2 = _triple(w, _SCALED, j)
        g0, g1, g2 = _triple(w, _NOISE, j)
        b0, b1, b2 = _0, _0, _0
        if bounce is not None:
            half = bounce * _HALF
            a0, a1, a2 = _triple(w, _AROUND, j)
            b0, b1, b2 = half * a0 * s0, half * a1 * s1, half * a2 * s2
        f, gx, gy, gz = _response(_triple(w, _LIGHT, j), n, v, curves[0], gloss)
        a11, a12, a22, ag1, ag2 = _pull(f, gx, gy, gz, n, t0, s0, g0, k0, b0)
        f, gx, gy, gz = _response(_triple(w, _LIGHT + 3, j), n, v, curves[1], gloss)
        b11, b12, b22, bg1, bg2 = _pull(f, gx, gy, gz, n, t1, s1, g1, k1, b1)
        f, gx, gy, gz = _response(_triple(w, _LIGHT + 6, j), n, v, curves[2], gloss)
        c11, c12, c22, cg1, cg2 = _pull(f, gx, gy, gz, n, t2, s2, g2, k2, b2)
        m11, m12, m22 = a11 + b11 + c11, a12 + b12 + c12, a22 + b22 + c22
        h1, h2 = ag1 + bg1 + cg1, ag2 + bg2 + cg2
        damp = _DAMP * (m11 + m22) + _TINY
        m11, m22 = m11 + damp, m22 + damp
        short = _1 / (m11 * m22 - m12 * m12)
        m1, m2 = (m22 * h1 - m12 * h2) * short, (m11 * h2 - m12 * h1) * short
        dx, dy, dz = -n[2] * m1, -n[2] * m2, n[0] * m1 + n[1] * m2
        move = dx * dx + dy * dy + dz * dz + _TINY
        held = _least(_LONGEST / sqrt(move), _1)
        nx, ny, nz = _limited(n[0] + held * dx, n[1] + held * dy, n[2] + held * dz)
        # What moved in earnest: a normal at the steepest that can be seen is pulled for ever.
        move = (nx - n[0]) * (nx - n[0]) + (ny - n[1]) * (ny - n[1])
        solved = (w[_KIND * _B + j] > _single(1.5)) & (k0 + k1 + k2 > _single(1.5))
        w[_MOVED * _B + j] = move if solved else _0
        _put(w, _NORMAL, j, (nx, ny, nz))
    longest = _0
    for j in range(_B):
        longest = _most(longest, w[_MOVED * _B + j])
    return longest


@_whole
def _end_block(w, drift, dark, bounce, shadows):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Turn a block's normals into slopes along the rays, their weights and their flags."""
    for j in range(_B):
        d, at = w[_DEPTH * _B + j], _single(j)
        wx, wy = drift[0] + at * drift[1], drift[2] + at * drift[3]
        n = _triple(w, _NORMAL, j)
        # What is dark is judged with the light from around that the normal found receives.
        (_, lit0, k0), (_, lit1, k1), (_, lit2, k2) = _channels(w, j, dark, bounce, n[2], shadows)
        known = k0 + k1 + k2
        solved = known > _single(1.5)
        nx, ny, nz = n[0] if solved else _0, n[1] if solved else _0, n[2] if solved else -_1
        along = nx * wx + ny * wy - nz
        hidden = (nz > -_STEEPEST - _DAMP) or (along < _LEAST_ALONG)
        trust = _1 if known > _single(2.5) else _ONE_DARK
        trust = _UNSOLVED if hidden or not solved else trust
        along = _1 / _most(along, _LEAST_ALONG)
        slope_x = (
            -(nx * (_1 + d * (drift[4] + at * drift[5])) + ny * d * (drift[6] + at * drift[7]))
            * along
        )
        slope_y = (
            -(nx * d * (drift[8] + at * drift[9]) + ny * (_1 + d * (drift[10] + at * drift[11])))
            * along
        )
        b0, b1, b2 = _triple(w, _SATURATED, j)
        unlit = lit0 * lit1 * lit2 < _HALF
        flag = (
            (_F_HIDDEN if hidden else _0)
            + (_F_SATURATED if b0 + b1 + b2 > _0 else _0)
            + (_F_DARK if unlit else _0)
        )
        kind = w[_KIND * _B + j]
        usable = kind > _single(1.5)
        w[_SLOPE * _B + j] = slope_x if usable else _0
        w[(_SLOPE + 1) * _B + j] = slope_y if usable else _0
        w[_TRUST * _B + j] = trust if usable else (_UNSOLVED if kind > _HALF else _1)
        w[_FLAG * _B + j] = flag if usable else _F_OUTSIDE
        w[_NORMAL * _B + j] = nx if usable else _0
        w[(_NORMAL + 1) * _B + j] = ny if usable else _0


@_part
def _ramps(static, row, place, count):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return drift and its derivatives along a block: value and step of each.

    Over a block they are straight lines within 1e-4, and six maps less are read from memory.
    """
    last = place + count - 1
    share = _1 / _single(max(count - 1, 1))
    return (
        static[6, row, place],
        (static[6, row, last] - static[6, row, place]) * share,
        static[7, row, place],
        (static[7, row, last] - static[7, row, place]) * share,
        static[8, row, place],
        (static[8, row, last] - static[8, row, place]) * share,
        static[9, row, place],
        (static[9, row, last] - static[9, row, place]) * share,
        static[10, row, place],
        (static[10, row, last] - static[10, row, place]) * share,
        static[11, row, place],
        (static[11, row, last] - static[11, row, place]) * share,
    )


@_whole
def solve_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first,
    last,
    ratio,
    around,
    saturated,
    depth,
    static,
    kind,
    corner,
    origin_mm,
    pitch_mm,
    leds,
    dark,
    curves,
    gloss,
    bounce,
    shadows,
    warm,
    slope_x,
    slope_y,
    weight,
    flags,
    normal_x,
    normal_y,
):
    """Solve rows `first` to `last` of a region whose corner in the static maps is `corner`.

    A `warm` start goes on from the normals that stand in `normal_x` and `normal_y`.
    `static` (12, rows, columns): 3 scales, 3 noises, drift x, y, and its four derivatives.
    """
    columns = depth.shape[1]
    w = np.zeros(_PLANES * _B, np.float32)
    begun = _1 if warm else _0
    pitch = _single(pitch_mm)
    for i in range(first, last):
        y = _single(origin_mm[1] + pitch_mm * (i + corner[0]))
        for begin in range(0, columns, _B):
            count = min(_B, columns - begin)
            place = corner[1] + begin
            row = i + corner[0]
            # Plain indices: a view of a row is counted, and threads would wait for the counter.
            for k in range(3):
                for j in range(count):
                    w[(_RATIO + k) * _B + j] = ratio[k, i, begin + j]
                if bounce is not None:
                    for j in range(count):
                        w[(_AROUND + k) * _B + j] = around[k, i, begin + j]
            for j in range(count):
                w[_DEPTH * _B + j] = depth[i, begin + j]
            for k in range(3):
                for j in range(count):
                    w[(_SCALE + k) * _B + j] = static[k, row, place + j]
                for j in range(count):
                    w[(_NOISE + k) * _B + j] = static[3 + k, row, place + j]
            for j in range(count):
                bits = saturated[i, begin + j]
                w[_SATURATED * _B + j] = _single(bits & 1)
                w[(_SATURATED + 1) * _B + j] = _single((bits >> 1) & 1)
                w[(_SATURATED + 2) * _B + j] = _single((bits >> 2) & 1)
                w[_KIND * _B + j] = _single(kind[row, place + j])
            if warm:
                for j in range(count):
                    w[_NORMAL * _B + j] = normal_x[i, begin + j]
                for j in range(count):
                    w[(_NORMAL + 1) * _B + j] = normal_y[i, begin + j]
            # What is left of a block that went before must not decide how many steps are done.
            for j in range(count, _B):
                w[_KIND * _B + j] = _0
            x_first = _single(origin_mm[0] + pitch_mm * place)
            drift = _ramps(static, row, place, count)
            _begin_block(
                w, drift, y, x_first, pitch, leds, dark, curves, gloss, bounce, shadows, begun
            )
            for _ in range(MOST_STEPS):
                if _step_block(w, dark, curves, gloss, bounce, shadows) < _SETTLED:
                    break
            _end_block(w, drift, dark, bounce, shadows)
            for j in range(count):
                slope_x[i, begin + j] = w[_SLOPE * _B + j]
            for j in range(count):
                slope_y[i, begin + j] = w[(_SLOPE + 1) * _B + j]
            for j in range(count):
                weight[i, begin + j] = w[_TRUST * _B + j]
            for j in range(count):
                normal_x[i, begin + j] = w[_NORMAL * _B + j]
            for j in range(count):
                normal_y[i, begin + j] = w[(_NORMAL + 1) * _B + j]
            for j in range(count):
                flags[i, begin + j] = np.uint8(w[_FLAG * _B + j])
