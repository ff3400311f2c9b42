"""The compiled near-light solve: one normal for each node, blocks of 64 nodes at a time.

For every node the surface point is placed along its refracted ray at the present depth; light
directions, inverse square and lobe are those at that place. Press over background is compared with
the membrane's response, and the normal is found by Gauss-Newton steps on the unit sphere. A dark or
saturated channel is left out, and the normal follows from the other two and |n| = 1. Of their two
solutions, the start value is the one in which the dark channel stays dark.

With a glossy lobe, the steps can end at several normals, of which only one fits. A step to a worse
fit is reverted, and if the final normal fits badly, a new search starts.

The parts stay in one file: the compiler's cache does not see changes of functions in others.

The loops have no branches and run in single precision, so that the processor solves eight or
sixteen nodes at once. Each block is copied into one small array: given many arrays, the compiler
cannot know that they do not overlap.
"""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base import compiling
from gelpolight_core.base.membrane_masks import DARK_SHARE, DARK_SIGMAS
from gelpolight_core.light.coating_stretch import LEAST_REFLECTANCE
from gelpolight_core.light.light_terms import LEAST_SLANT
from gelpolight_core.reconstruction.compiled import BLOCK, HALF, ONE, ZERO, single
from gelpolight_core.reconstruction.height_map import Flag

STEEPEST_NZ = 0.15
"""Normals are limited to this z: steeper walls cannot be seen from above."""
LEAST_ALONG_RAY = 0.1
"""Below this cosine between normal and ray, scaled by the ray's length, a wall is hidden."""
ONE_DARK_WEIGHT, ONE_HIDDEN_WEIGHT = 0.5, 0.1
"""Of nodes with two lights: of a membrane that gives no light to itself, and of one that does. On a
wall that one light does not reach, interreflected light rises with the slope as direct light falls,
so that an error of it moves their slopes more than those of nodes with three. The second weight is
chosen: on four rendered sensors, 0.5 made the RMS 1 to 29 % larger."""
UNSOLVED_WEIGHT = 0.003
"""Of nodes with fewer than two lights, which are assumed flat; 0.01 lost 0.2 % of height on
walls."""
MODEL_ERROR = 0.03
"""Error of the model in press over background; in a good image it is larger than the noise."""
SEARCHED_DEG = 8.0
"""A search leaves out normals that are nearer than this to the one that fits badly."""
BAD_FIT = 25.0
"""From this misfit on, in squared standard deviations, a normal is searched for again."""


_B = BLOCK
# Planes of a block's array: what is read, what is worked with, and what is written; the factor of
# the stretch on the reflectance; of a glossy membrane, the best normal so far, its misfit, the step
# from it, and where the steps from another start ended.
_WIDTHS = (3, 3, 3, 12, 1, 4, 4, 1, 3, 3, 3, 9, 3, 2, 1, 1, 1, 1, 3, 1, 3, 3, 1)
# NumPy's whole numbers: for each of Python's, a part that takes it is compiled once more.
_FIRST = np.cumsum(_WIDTHS) - _WIDTHS
_RATIO, _SCALE, _NOISE, _AROUND, _DEPTH, _MARKS, _HIDDEN, _KIND, _REST, *_LATER = _FIRST
_SCALED, _NORMAL, _LIGHT, _VIEW, _SLOPE, _TRUST, _FLAG, _MOVED, _STRETCHED, *_GLOSSY = _LATER
_BEST, _MISFIT, _STEP, _OTHER, _OTHER_MISFIT = _GLOSSY
_RED, _GREEN, _BLUE = np.arange(3)
_RAY_0, _RAY_1, _RAY_2, _RAY_3, _RAY_4, _RAY_5 = np.arange(6)
_YES = np.bool_(True)
_PI = single(pi)
_LEAST_COSINE, _LEAST_VIEW = single(1e-3), single(1e-2)
_STEEPEST = single(STEEPEST_NZ)
_LEVEL = single(sqrt(1.0 - STEEPEST_NZ**2))
_LEAST_ALONG = single(LEAST_ALONG_RAY)
_ELSEWHERE = single(cos(radians(SEARCHED_DEG)))
_LEAST_DISTANCE = single(0.1)
_ONE_DARK, _UNSOLVED = single(ONE_DARK_WEIGHT), single(UNSOLVED_WEIGHT)
_ONE_HIDDEN = single(ONE_HIDDEN_WEIGHT)
_MODEL2 = single(MODEL_ERROR * MODEL_ERROR)
_LEAST_SLANT, _LEAST_REFLECTANCE = single(LEAST_SLANT), single(LEAST_REFLECTANCE)
_SIGMAS, _SHARE = single(DARK_SIGMAS), single(DARK_SHARE)
_LONGEST, _WORST, _BAD = single(0.3), single(1e30), single(BAD_FIT)
_DAMP, _TINY = single(1e-6), single(1e-12)
_F_OUTSIDE, _F_SATURATED = single(Flag.OUTSIDE), single(Flag.SATURATED)
_F_DARK, _F_HIDDEN = single(Flag.DARK), single(Flag.NOT_OBSERVABLE)
_F_FAR, _F_INVALID = single(Flag.EXTRAPOLATED), single(Flag.INVALID)

START_RINGS = ((8.0, 5), (20.0, 8), (33.0, 10), (47.0, 12), (60.0, 12))
"""Tilt in degrees, and how many normals that much tilted a search tries."""


def _starts() -> NDArray[np.float32]:
    """Return normals all around: the flat one, and rings of tilted ones."""
    normals = [(0.0, 0.0, -1.0)]
    for tilt_deg, count in START_RINGS:
        for k in range(count):
            azimuth, tilt = 2.0 * pi * k / count, radians(tilt_deg)
            normals.append((sin(tilt) * cos(azimuth), sin(tilt) * sin(azimuth), -cos(tilt)))
    return np.array(normals, np.float32)


STARTS = _starts()

_part = compiling.part(fastmath=True, error_model="numpy")
_whole = compiling.whole(fastmath=True, error_model="numpy")


@_part
def _most(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a if a > b else b


@_part
def _least(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a if a < b else b


@_part
def _curve(c, p, table, k):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the diffuse share at a cosine with its derivative."""
    if table is not None:
        position = c * single(table.shape[1] - 1)
        below = min(int(position), table.shape[1] - 2)
        rise = table[k, below + 1] - table[k, below]
        return table[k, below] + (position - single(below)) * rise, rise * single(
            table.shape[1] - 1
        )
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
def _response(l, n, v, p, table, gloss, k):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled # noqa: E741
    """Return the brightness under one light with its gradient by the (free) normal.

    As :meth:`MembraneBrdf.response`.
    """
    facing = l[0] * n[0] + l[1] * n[1] + l[2] * n[2]
    c = _most(facing, _LEAST_COSINE)
    f, by_c = _curve(_least(c, ONE), p, table, k)
    if gloss is None:
        on = ONE if facing > ZERO else ZERO
        return f * on, by_c * l[0] * on, by_c * l[1] * on, by_c * l[2] * on
    share, a2 = gloss
    hx, hy, hz = l[0] + v[0], l[1] + v[1], l[2] + v[2]
    short = ONE / sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx * short, hy * short, hz * short
    t = _most(hx * n[0] + hy * n[1] + hz * n[2], ZERO)
    s = _most(v[0] * n[0] + v[1] * n[1] + v[2] * n[2], _LEAST_VIEW)
    b2 = ONE - a2
    width = ONE / (ONE - t * t * b2)
    rc = sqrt(a2 + b2 * c * c)
    rs = sqrt(a2 + b2 * s * s)
    lit_share = ONE / (c + rc)
    seen_share = ONE / (s + rs)
    # D(t) * 2c / (c + rc) * 2s / (s + rs) / (4 s)
    lobe = share * a2 / _PI * width * width * lit_share * seen_share
    g = lobe * c
    on = ONE if facing > ZERO else ZERO
    by_c = (by_c + lobe * (ONE - c * lit_share * (ONE + b2 * c / rc))) * on
    by_t = g * single(4.0) * b2 * t * width * on
    by_s = -g * seen_share * (ONE + b2 * s / rs) * on
    return (
        (f + g) * on,
        by_c * l[0] + by_t * hx + by_s * v[0],
        by_c * l[1] + by_t * hy + by_s * v[1],
        by_c * l[2] + by_t * hz + by_s * v[2],
    )


@_part
def _limited(nx, ny, nz):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the normal at unit length and not steeper than can be seen."""
    size = ONE / sqrt(nx * nx + ny * ny + nz * nz + _TINY)
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
    """Return a light's direction at the present depth, and r^3 / z of its near-light gain.

    A surface at the height of the light or beyond is treated as lit from just below it.
    """
    ax, ay = led[0] - x, led[1] - y
    az = _least(led[2] + d, -_LEAST_DISTANCE)
    r2 = ax * ax + ay * ay + az * az
    short = ONE / sqrt(r2)
    return (ax * short, ay * short, az * short), r2 * r2 * short / az


@_part
def _direct_light(ratio, around, sigma, sat, hidden, judged, scale, dark):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the direct light of a channel, with 1 or 0 for lit and for counted.

    Where shadows are `judged` by the present surface, a channel is dark where its light is hidden;
    otherwise where it shows almost no direct light.
    """
    direct = (ratio - around) * scale
    low = _most(dark, _least(_SIGMAS * sigma, _SHARE) * scale)
    lit = ONE if direct >= low else ZERO
    lit = ONE - hidden if judged > ZERO else lit
    return direct, lit, ZERO if sat > ZERO else lit


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
    short = ONE / _inner(l0, p)
    ax = (e0 * p[0] + e1 * q[0] + e2 * r[0]) * short
    ay = (e0 * p[1] + e1 * q[1] + e2 * r[1]) * short
    az = (e0 * p[2] + e1 * q[2] + e2 * r[2]) * short
    is0, is1 = w0 == ZERO, w1 == ZERO
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
    det = ONE / (ONE - between * between)
    ka, kb = (ea - between * eb) * det, (eb - between * ea) * det
    bx, by, bz = ka * a[0] + kb * b[0], ka * a[1] + kb * b[1], ka * a[2] + kb * b[2]
    remaining = (ONE - bx * bx - by * by - bz * bz) / (ex * ex + ey * ey + ez * ez)
    step = sqrt(_most(remaining, single(1e-4)))
    # Away from a dark light, towards a saturated one.
    side = ex * c[0] + ey * c[1] + ez * c[2]
    towards = side if bright > ZERO else -side
    step = step if towards > ZERO else -step
    one = w0 + w1 + w2 < single(2.5)
    return _limited(
        bx + step * ex if one else ax,
        by + step * ey if one else ay,
        bz + step * ez if one else az,
    )


@_part
def _pull(f, gx, gy, gz, n, direct, scale, sigma, weight):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a channel's part of the Gauss-Newton equations along two tangents of n, and misfit.

    The tangents are (-nz, 0, nx) and (0, -nz, ny).
    """
    d1 = n[0] * gz - n[2] * gx
    d2 = n[1] * gz - n[2] * gy
    w = weight / ((sigma * sigma + _MODEL2) * scale * scale)
    e = w * (direct - f)
    return w * d1 * d1, w * d1 * d2, w * d2 * d2, d1 * e, d2 * e, e * (direct - f)


@_part
def _total(w, k, j, values):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return brightness under one light, with the gradient of all light by the normal.

    Light from other parts of the membrane depends on the normal that receives it, too.
    """
    f, gx, gy, gz = values
    scale = w[(_SCALED + k) * _B + j]
    x, y, z = _triple(w, _AROUND + 3 + 3 * k, j)
    return f, gx + scale * x, gy + scale * y, gz + scale * z


@_part
def _triple(w, first, j):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return w[first * _B + j], w[(first + 1) * _B + j], w[(first + 2) * _B + j]


@_part
def _put(w, first, j, values):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    w[first * _B + j] = values[0]
    w[(first + 1) * _B + j] = values[1]
    w[(first + 2) * _B + j] = values[2]


@_part
def _channels(w, j, dark):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the result of `_direct_light` for the three channels of a node at its normal."""
    r0, r1, r2 = _triple(w, _RATIO, j)
    n = _triple(w, _NORMAL, j)
    a0, a1, a2 = _triple(w, _AROUND, j)
    a0 = _most(a0 + _inner(_triple(w, _AROUND + 3, j), n), ZERO)
    a1 = _most(a1 + _inner(_triple(w, _AROUND + 6, j), n), ZERO)
    a2 = _most(a2 + _inner(_triple(w, _AROUND + 9, j), n), ZERO)
    g0, g1, g2 = _triple(w, _NOISE, j)
    b0, b1, b2 = _triple(w, _MARKS, j)
    h0, h1, h2 = _triple(w, _HIDDEN, j)
    s0, s1, s2 = _triple(w, _SCALED, j)
    judged = w[(_HIDDEN + 3) * _B + j]
    return (
        _direct_light(r0, a0, g0, b0, h0, judged, s0, dark[0]),
        _direct_light(r1, a1, g1, b1, h1, judged, s1, dark[1]),
        _direct_light(r2, a2, g2, b2, h2, judged, s2, dark[2]),
    )


@_part
def _rest(w, j, rest):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return height, slopes and normal of the membrane at rest."""
    if rest is None:
        return (ZERO, ZERO, ZERO), (ZERO, ZERO, -ONE)
    height, slope_x, slope_y = _triple(w, _REST, j)
    short = ONE / sqrt(slope_x * slope_x + slope_y * slope_y + ONE)
    return (height, slope_x, slope_y), (slope_x * short, slope_y * short, -short)


@_part
def _begin_block(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    w, rays, position, leds, dark, curves, table, gloss, warm, rest
):
    """Find lights, view and a first normal of a block's nodes.

    Started `warm`, the stored normals are used where all three lights count.
    """
    y, x_first, pitch = position
    for j in range(_B):
        d, at = w[_DEPTH * _B + j], single(j)
        wx, wy = rays[0] + at * rays[1], rays[2] + at * rays[3]
        x = x_first + pitch * at + d * wx
        short = ONE / sqrt(wx * wx + wy * wy + ONE)
        v = (wx * short, wy * short, -short)
        (height, _, _), flat = _rest(w, j, rest)
        l0, near0 = _light(leds[0], x, y + d * wy, d - height)
        l1, near1 = _light(leds[1], x, y + d * wy, d - height)
        l2, near2 = _light(leds[2], x, y + d * wy, d - height)
        s0, s1, s2 = _triple(w, _SCALE, j)
        _put(w, _SCALED, j, (s0 * near0, s1 * near1, s2 * near2))
        px, py = w[_NORMAL * _B + j], w[(_NORMAL + 1) * _B + j]
        w[(_NORMAL + 2) * _B + j] = pz = -sqrt(_most(ONE - px * px - py * py, _TINY))
        (d0, _, k0), (d1, _, k1), (d2, _, k2) = _channels(w, j, dark)
        f0 = _response(l0, flat, v, curves[0], table, gloss, _RED)[0]
        f1 = _response(l1, flat, v, curves[1], table, gloss, _GREEN)[0]
        f2 = _response(l2, flat, v, curves[2], table, gloss, _BLUE)[0]
        e0 = _least(_inner(l0, flat) * _most(d0, ZERO) / _most(f0, _DAMP), ONE)
        e1 = _least(_inner(l1, flat) * _most(d1, ZERO) / _most(f1, _DAMP), ONE)
        e2 = _least(_inner(l2, flat) * _most(d2, ZERO) / _most(f2, _DAMP), ONE)
        b0, b1, b2 = _triple(w, _MARKS, j)
        nx, ny, nz = _start(l0, l1, l2, e0, e1, e2, k0, k1, k2, b0, b1, b2)
        on = warm * (k0 + k1 + k2 + w[(_HIDDEN + 3) * _B + j]) > single(2.5)
        _put(w, _NORMAL, j, (px if on else nx, py if on else ny, pz if on else nz))
        _put(w, _LIGHT, j, l0)
        _put(w, _LIGHT + 3, j, l1)
        _put(w, _LIGHT + 6, j, l2)
        _put(w, _VIEW, j, v)


@_part
def _stretch_block(w, loss, rest):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Compare a block's light with a coating that is stretched as its present normals say.

    As :func:`stretched_reflectance`: the membrane moves along z, so areas are as z of the normals.
    """
    for j in range(_B):
        _, flat = _rest(w, j, rest)
        area = flat[2] / _least(w[(_NORMAL + 2) * _B + j], -_LEAST_SLANT)
        factor = _most(ONE - loss * (area - ONE), _LEAST_REFLECTANCE)
        change = w[_STRETCHED * _B + j] / factor
        s0, s1, s2 = _triple(w, _SCALED, j)
        _put(w, _SCALED, j, (s0 * change, s1 * change, s2 * change))
        w[_STRETCHED * _B + j] = factor


@_part
def _misfit(w, n, j, channels, curves, table, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return how far a normal is from a node's light, in squared standard deviations."""
    v = _triple(w, _VIEW, j)
    f0 = _response(_triple(w, _LIGHT, j), n, v, curves[0], table, gloss, _RED)[0]
    f1 = _response(_triple(w, _LIGHT + 3, j), n, v, curves[1], table, gloss, _GREEN)[0]
    f2 = _response(_triple(w, _LIGHT + 6, j), n, v, curves[2], table, gloss, _BLUE)[0]
    s0, s1, s2 = _triple(w, _SCALED, j)
    g0, g1, g2 = _triple(w, _NOISE, j)
    (t0, _, k0), (t1, _, k1), (t2, _, k2) = channels
    e0, e1, e2 = t0 - f0, t1 - f1, t2 - f2
    w0 = k0 / ((g0 * g0 + _MODEL2) * s0 * s0)
    w1 = k1 / ((g1 * g1 + _MODEL2) * s1 * s1)
    w2 = k2 / ((g2 * g2 + _MODEL2) * s2 * s2)
    return w0 * e0 * e0 + w1 * e1 * e1 + w2 * e2 * e2


@_part
def _search_block(w, dark, curves, table, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Where three lights fit badly, start again from the best of many normals farther away.

    Under a glossy lobe, brightness rises and falls with slope: steps from a bad start end at a
    normal that fits worse than the true one. Returns whether any node starts again.
    """
    worst = ZERO
    for j in range(_B):
        (_, _, k0), (_, _, k1), (_, _, k2) = _channels(w, j, dark)
        judged = (k0 + k1 + k2 > single(2.5)) & (w[_KIND * _B + j] > single(1.5))
        misfit = w[_MISFIT * _B + j] if judged else ZERO
        w[_OTHER_MISFIT * _B + j] = misfit
        _put(w, _OTHER, j, _triple(w, _NORMAL, j))
        w[_MISFIT * _B + j] = _WORST
        worst = _most(worst, misfit)
    if worst < _BAD:
        return False
    for j in range(_B):
        if w[_OTHER_MISFIT * _B + j] > _BAD:
            channels = _channels(w, j, dark)
            min_misfit, rejected = _WORST, _triple(w, _OTHER, j)
            for k in range(STARTS.shape[0]):
                n = (STARTS[k, 0], STARTS[k, 1], STARTS[k, 2])
                misfit = _misfit(w, n, j, channels, curves, table, gloss)
                if _inner(n, rejected) < _ELSEWHERE and misfit < min_misfit:
                    min_misfit = misfit
                    _put(w, _NORMAL, j, n)
    return True


@_part
def _compare_block(w):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Of both ends of a search, take the one that fits better."""
    for j in range(_B):
        n, other = _triple(w, _NORMAL, j), _triple(w, _OTHER, j)
        better = w[_MISFIT * _B + j] < w[_OTHER_MISFIT * _B + j]
        _put(w, _NORMAL, j, _chosen(better, better, n, n, other))


@_part
def _step_block(w, dark, curves, table, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Do a Gauss-Newton step at a block's nodes, and return the square of the longest.

    Under a glossy lobe, a step that fits worse than the best normal so far is taken back, and a
    shorter one is tried.
    """
    for j in range(_B):
        n, v = _triple(w, _NORMAL, j), _triple(w, _VIEW, j)
        (t0, _, k0), (t1, _, k1), (t2, _, k2) = _channels(w, j, dark)
        s0, s1, s2 = _triple(w, _SCALED, j)
        g0, g1, g2 = _triple(w, _NOISE, j)
        lit = _response(_triple(w, _LIGHT, j), n, v, curves[0], table, gloss, _RED)
        f, gx, gy, gz = _total(w, _RED, j, lit)
        a11, a12, a22, ag1, ag2, am = _pull(f, gx, gy, gz, n, t0, s0, g0, k0)
        lit = _response(_triple(w, _LIGHT + 3, j), n, v, curves[1], table, gloss, _GREEN)
        f, gx, gy, gz = _total(w, _GREEN, j, lit)
        b11, b12, b22, bg1, bg2, bm = _pull(f, gx, gy, gz, n, t1, s1, g1, k1)
        lit = _response(_triple(w, _LIGHT + 6, j), n, v, curves[2], table, gloss, _BLUE)
        f, gx, gy, gz = _total(w, _BLUE, j, lit)
        c11, c12, c22, cg1, cg2, cm = _pull(f, gx, gy, gz, n, t2, s2, g2, k2)
        m11, m12, m22 = a11 + b11 + c11, a12 + b12 + c12, a22 + b22 + c22
        h1, h2 = ag1 + bg1 + cg1, ag2 + bg2 + cg2
        damp = _DAMP * (m11 + m22) + _TINY
        m11, m22 = m11 + damp, m22 + damp
        short = ONE / (m11 * m22 - m12 * m12)
        m1, m2 = (m22 * h1 - m12 * h2) * short, (m11 * h2 - m12 * h1) * short
        dx, dy, dz = -n[2] * m1, -n[2] * m2, n[0] * m1 + n[1] * m2
        move = dx * dx + dy * dy + dz * dz + _TINY
        held = _least(_LONGEST / sqrt(move), ONE)
        step, base = (held * dx, held * dy, held * dz), n
        if gloss is not None:
            step, base = _kept(w, j, n, step, am + bm + cm)
        nx, ny, nz = _limited(base[0] + step[0], base[1] + step[1], base[2] + step[2])
        # The real movement: a normal at the slope limit would be moved in every step.
        move = (nx - n[0]) * (nx - n[0]) + (ny - n[1]) * (ny - n[1])
        solved = (w[_KIND * _B + j] > single(1.5)) & (k0 + k1 + k2 > single(1.5))
        w[_MOVED * _B + j] = move if solved else ZERO
        _put(w, _NORMAL, j, (nx, ny, nz))
    longest = ZERO
    for j in range(_B):
        longest = _most(longest, w[_MOVED * _B + j])
    return longest


@_part
def _kept(w, j, n, step, misfit):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the step to take, and from where: from n, or a shorter one from the best before it.

    Where n fits badly and the normal before it did better, the step between them was too long.
    """
    better = misfit <= _most(w[_MISFIT * _B + j], _BAD)
    old, best = _triple(w, _STEP, j), _triple(w, _BEST, j)
    shorter = (HALF * old[0], HALF * old[1], HALF * old[2])
    step, base = _chosen(better, better, step, step, shorter), _chosen(better, better, n, n, best)
    w[_MISFIT * _B + j] = misfit if better else w[_MISFIT * _B + j]
    _put(w, _BEST, j, base)
    _put(w, _STEP, j, step)
    return step, base


@_part
def _best_block(w, dark, curves, table, gloss):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Go back to the best normal where the last step fits worse."""
    for j in range(_B):
        n, best = _triple(w, _NORMAL, j), _triple(w, _BEST, j)
        channels = _channels(w, j, dark)
        misfit = _misfit(w, n, j, channels, curves, table, gloss)
        better = misfit <= _most(w[_MISFIT * _B + j], _BAD)
        w[_MISFIT * _B + j] = misfit if better else w[_MISFIT * _B + j]
        _put(w, _NORMAL, j, _chosen(better, better, n, n, best))


@_part
def _unseen(w, light, n, j, range_of, counts):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return 1 where a used channel has a cosine outside the range of the ball presses."""
    c = _inner(_triple(w, light, j), n)
    return counts if (c < range_of[0]) | (c > range_of[1]) else ZERO


@_part
def _end_block(w, rays, dark, coverage, rest):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Turn a block's normals into slopes along the rays, their weights and their flags."""
    for j in range(_B):
        d, at = w[_DEPTH * _B + j], single(j)
        wx, wy = rays[0] + at * rays[1], rays[2] + at * rays[3]
        n = _triple(w, _NORMAL, j)
        (_, lit0, k0), (_, lit1, k1), (_, lit2, k2) = _channels(w, j, dark)
        channels = k0 + k1 + k2
        solved = channels > single(1.5)
        (_, rest_x, rest_y), flat = _rest(w, j, rest)
        nx, ny, nz = _chosen(solved, solved, n, n, flat)
        along = nx * wx + ny * wy - nz
        hidden = (nz > -_STEEPEST - _DAMP) or (along < _LEAST_ALONG)
        two = _ONE_HIDDEN if w[(_HIDDEN + 3) * _B + j] > ZERO else _ONE_DARK
        trust = ONE if channels > single(2.5) else two
        trust = _UNSOLVED if hidden or not solved else trust
        along = ONE / _most(along, _LEAST_ALONG)
        # d_u = - n . (P0_u + d w_u) / (n . w): the surface point moves along its own ray.
        slope_x = nx * (ONE + d * (rays[4] + at * rays[5])) + ny * d * (rays[6] + at * rays[7])
        slope_y = nx * d * (rays[8] + at * rays[9]) + ny * (ONE + d * (rays[10] + at * rays[11]))
        slope_x, slope_y = -(slope_x + nz * rest_x) * along, -(slope_y + nz * rest_y) * along
        far = (
            _unseen(w, _LIGHT, n, j, coverage[0], k0)
            + _unseen(w, _LIGHT + 3, n, j, coverage[1], k1)
            + _unseen(w, _LIGHT + 6, n, j, coverage[2], k2)
        )
        b0, b1, b2 = _triple(w, _MARKS, j)
        invalid = w[(_MARKS + 3) * _B + j]
        unlit = lit0 * lit1 * lit2 < HALF
        flag = (
            (_F_HIDDEN if hidden else ZERO)
            + (_F_SATURATED if b0 + b1 + b2 - single(3.0) * invalid > ZERO else ZERO)
            + (_F_DARK if unlit else ZERO)
            + (_F_FAR if solved and far > ZERO else ZERO)
            + _F_INVALID * invalid
        )
        kind = w[_KIND * _B + j]
        usable = kind > single(1.5)
        w[_SLOPE * _B + j] = slope_x if usable else ZERO
        w[(_SLOPE + 1) * _B + j] = slope_y if usable else ZERO
        w[_TRUST * _B + j] = trust if usable else (_UNSOLVED if kind > HALF else ONE)
        w[_FLAG * _B + j] = flag if usable else (_F_OUTSIDE + (_F_INVALID if kind > HALF else ZERO))
        w[_NORMAL * _B + j] = nx if usable else flat[0]
        w[(_NORMAL + 1) * _B + j] = ny if usable else flat[1]


@_part
def _ray_value(rays, k, y, x):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a ray map between its nodes, continued straight beyond the outermost ones."""
    i = min(max(int(np.floor(y)), 0), rays.shape[1] - 2)
    j = min(max(int(np.floor(x)), 0), rays.shape[2] - 2)
    fy, fx = single(y - i), single(x - j)
    up = rays[k, i, j] + fx * (rays[k, i, j + 1] - rays[k, i, j])
    low = rays[k, i + 1, j] + fx * (rays[k, i + 1, j + 1] - rays[k, i + 1, j])
    return up + fy * (low - up)


@_part
def _ramp(rays, k, y, x, last, share):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    value = _ray_value(rays, k, y, x)
    return value, (_ray_value(rays, k, y, last) - value) * share


@_part
def ray_ramps(scale, row, position, count):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return ray slope and derivatives along a block of nodes: value and step of each.

    Over a block they are straight lines within 1e-4. `row` and `position` are the first node's.
    """
    rays, step = scale.rays, scale.ray_step
    y = (row + 0.5) * step - 0.5
    x = (position + 0.5) * step - 0.5
    last = (position + count - 0.5) * step - 0.5
    share = ONE / single(max(count - 1, 1))
    a, a1 = _ramp(rays, _RAY_0, y, x, last, share)
    b, b1 = _ramp(rays, _RAY_1, y, x, last, share)
    c, c1 = _ramp(rays, _RAY_2, y, x, last, share)
    d, d1 = _ramp(rays, _RAY_3, y, x, last, share)
    e, e1 = _ramp(rays, _RAY_4, y, x, last, share)
    f, f1 = _ramp(rays, _RAY_5, y, x, last, share)
    return a, a1, b, b1, c, c1, d, d1, e, e1, f, f1


@_part
def _gain_block(w, by_depth, row, position, count):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Multiply the scale of a block's nodes by `PyramidLevel.by_depth` at their depths."""
    for k in range(3):
        for j in range(count):
            d, at = w[_DEPTH * _B + j], position + j
            bend = by_depth[3 + k, row, at] + d * by_depth[6 + k, row, at]
            w[(_SCALE + k) * _B + j] *= by_depth[k, row, at] + d * bend


@_part
def _load(w, image, depth, scale, rest, corner, reflects, slopes, warm, i, begin, count):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Copy a block of row `i` into the work array."""
    row, position = i + corner[0], begin + corner[1]
    # Plain indices: a view of a row is counted, and threads would wait for the counter.
    ratio, noise, around, marks = image.ratio, image.noise, image.around, image.marks
    flat, kind = scale.flat, scale.kind
    from_around = reflects and around.shape[2] > 1
    for k in range(3):
        for j in range(count):
            w[(_RATIO + k) * _B + j] = ratio[k, i, begin + j]
        for j in range(count):
            w[(_NOISE + k) * _B + j] = noise[k, i, begin + j]
        for j in range(count):
            w[(_SCALE + k) * _B + j] = flat[k, row, position + j]
    if from_around:
        for k in range(12):
            for j in range(count):
                w[(_AROUND + k) * _B + j] = around[k, i, begin + j]
    for j in range(count):
        w[_DEPTH * _B + j] = depth[i, begin + j]
    for j in range(count):
        bits = marks[i, begin + j]
        w[_MARKS * _B + j] = single(bits & 1)
        w[(_MARKS + 1) * _B + j] = single((bits >> 1) & 1)
        w[(_MARKS + 2) * _B + j] = single((bits >> 2) & 1)
        w[(_MARKS + 3) * _B + j] = single((bits >> 3) & 1)
        w[_HIDDEN * _B + j] = single((bits >> 4) & 1)
        w[(_HIDDEN + 1) * _B + j] = single((bits >> 5) & 1)
        w[(_HIDDEN + 2) * _B + j] = single((bits >> 6) & 1)
        w[(_HIDDEN + 3) * _B + j] = single((bits >> 7) & 1)
        w[_KIND * _B + j] = single(kind[row, position + j])
    if rest is not None:
        for k in range(3):
            for j in range(count):
                w[(_REST + k) * _B + j] = rest[k, row, position + j]
    if warm:
        for j in range(count):
            w[_NORMAL * _B + j] = slopes.normal_x[i, begin + j]
        for j in range(count):
            w[(_NORMAL + 1) * _B + j] = slopes.normal_y[i, begin + j]
    # Data of an earlier block must not affect the number of steps.
    for j in range(count, _B):
        w[_KIND * _B + j] = ZERO


@_part
def _store(w, plane, target, i, begin, count):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for j in range(count):
        target[i, begin + j] = w[plane * _B + j]


@_whole
def solve_rows(first, last, image, depth, scale, corner, membrane, steps, slopes):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Solve rows `first` to `last` of a region whose first node is `corner` (row, column).

    Parameters
    ----------
    image : RatioImage
        Image of the region.
    depth : (rows, columns) float32
        Present depth at each node's ray.
    scale, membrane, steps
        :class:`PyramidLevel`, :class:`MembraneParameters`, :class:`GaussNewtonOptions`.
    slopes : RegionSlopes
        Written; its normals are read where the start is warm.
    """
    columns = depth.shape[1]
    leds, dark, curves, table = membrane.leds, membrane.dark, membrane.curves, membrane.table
    gloss, coverage, loss = membrane.gloss, membrane.coverage, membrane.stretch_loss
    reflects, stretches = membrane.interreflection > ZERO, loss != ZERO
    changes = scale.by_depth.size > 0
    most, settled, warm = steps.most, single(steps.settled), steps.warm
    w = np.zeros(sum(_WIDTHS) * _B, np.float32)
    begun, pitch, rest = ONE if warm else ZERO, single(scale.pitch_mm), scale.rest
    for i in range(first, last):
        y = single(scale.y_mm + scale.pitch_mm * (i + corner[0]))
        for begin in range(0, columns, _B):
            count = min(_B, columns - begin)
            position = corner[1] + begin
            _load(w, image, depth, scale, rest, corner, reflects, slopes, warm, i, begin, count)
            at = (y, single(scale.x_mm + scale.pitch_mm * position), pitch)
            rays = ray_ramps(scale, i + corner[0], position, count)
            if changes:
                _gain_block(w, scale.by_depth, i + corner[0], position, count)
            _begin_block(w, rays, at, leds, dark, curves, table, gloss, begun, rest)
            if stretches:
                w[_STRETCHED * _B : (_STRETCHED + 1) * _B] = ONE
            if gloss is not None:
                w[_MISFIT * _B : (_MISFIT + 1) * _B] = _WORST
            for _ in range(most):
                if stretches:
                    _stretch_block(w, loss, rest)
                if _step_block(w, dark, curves, table, gloss) < settled:
                    break
            if gloss is not None:
                _best_block(w, dark, curves, table, gloss)
                if _search_block(w, dark, curves, table, gloss):
                    for _ in range(most):
                        if stretches:
                            _stretch_block(w, loss, rest)
                        _step_block(w, dark, curves, table, gloss)
                    _best_block(w, dark, curves, table, gloss)
                    _compare_block(w)
            _end_block(w, rays, dark, coverage, rest)
            _store(w, _SLOPE, slopes.slope_x, i, begin, count)
            _store(w, _SLOPE + 1, slopes.slope_y, i, begin, count)
            _store(w, _TRUST, slopes.weight, i, begin, count)
            _store(w, _NORMAL, slopes.normal_x, i, begin, count)
            _store(w, _NORMAL + 1, slopes.normal_y, i, begin, count)
            for j in range(count):
                slopes.flags[i, begin + j] = np.uint8(w[_FLAG * _B + j])


@_part
def _left_over(w, j, dark, curves, table, gloss, rest):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a node's light that no normal explains, its whole light, noise, slope and contrast.

    Three channels have one direction more than a normal: that in which no change of the normal
    changes them. All are NaN where a channel is dark, saturated or hidden.
    """
    n, v = _triple(w, _NORMAL, j), _triple(w, _VIEW, j)
    (t0, _, k0), (t1, _, k1), (t2, _, k2) = _channels(w, j, dark)
    s0, s1, s2 = _triple(w, _SCALED, j)
    lit = _response(_triple(w, _LIGHT, j), n, v, curves[0], table, gloss, _RED)
    f0, x0, y0, z0 = _total(w, _RED, j, lit)
    lit = _response(_triple(w, _LIGHT + 3, j), n, v, curves[1], table, gloss, _GREEN)
    f1, x1, y1, z1 = _total(w, _GREEN, j, lit)
    lit = _response(_triple(w, _LIGHT + 6, j), n, v, curves[2], table, gloss, _BLUE)
    f2, x2, y2, z2 = _total(w, _BLUE, j, lit)
    c0, c1, c2 = _cross(
        (
            (n[0] * z0 - n[2] * x0) / s0,
            (n[0] * z1 - n[2] * x1) / s1,
            (n[0] * z2 - n[2] * x2) / s2,
        ),
        (
            (n[1] * z0 - n[2] * y0) / s0,
            (n[1] * z1 - n[2] * y1) / s1,
            (n[1] * z2 - n[2] * y2) / s2,
        ),
    )
    short = ONE / sqrt(c0 * c0 + c1 * c1 + c2 * c2 + _TINY)
    c = (c0 * short, c1 * short, c2 * short)
    residual = _inner(((t0 - f0) / s0, (t1 - f1) / s1, (t2 - f2) / s2), c)
    whole = _inner((f0 / s0, f1 / s1, f2 / s2), c)
    g0, g1, g2 = _triple(w, _NOISE, j)
    noise = sqrt(g0 * g0 * c[0] * c[0] + g1 * g1 * c[1] * c[1] + g2 * g2 * c[2] * c[2])
    (_, rest_x, rest_y), _ = _rest(w, j, rest)
    slope_x, slope_y = rest_x + n[0] / n[2], rest_y + n[1] / n[2]
    slope = sqrt(slope_x * slope_x + slope_y * slope_y)
    is_known = (k0 + k1 + k2 > single(2.5)) & (w[_KIND * _B + j] > single(1.5))
    gap = single(np.nan)
    r0, r1, r2 = _triple(w, _RATIO, j)
    contrast = _inner((r0 - ONE, r1 - ONE, r2 - ONE), c)
    known = (residual, whole, noise, slope, contrast)
    return known if is_known else (gap, gap, gap, gap, gap)


@_whole
def residual_rows(first, last, image, depth, scale, corner, membrane, slopes, step, left):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Compare every `step`-th row of a solved region with the light that its normals explain.

    Parameters
    ----------
    first, last : int
        Rows of `left`.
    image, depth, scale, corner, membrane, slopes
        As for :func:`solve_rows`, solved.
    step : int
        Rows to a row of `left`.
    left : (5, rows / step, columns) float32
        Light that no normal explains, the whole light in the same direction, its noise, all over
        the flat membrane's, the slope, and the change of the light by the contact in this
        direction; NaN where they are not known. Written.
    """
    columns = depth.shape[1]
    leds, dark, curves, table = membrane.leds, membrane.dark, membrane.curves, membrane.table
    gloss, reflects = membrane.gloss, membrane.interreflection > ZERO
    loss, changes = membrane.stretch_loss, scale.by_depth.size > 0
    stretches = loss != ZERO
    w = np.zeros(sum(_WIDTHS) * _B, np.float32)
    pitch, rest = single(scale.pitch_mm), scale.rest
    for k in range(first, last):
        i = k * step
        y = single(scale.y_mm + scale.pitch_mm * (i + corner[0]))
        for begin in range(0, columns, _B):
            count = min(_B, columns - begin)
            position = corner[1] + begin
            _load(w, image, depth, scale, rest, corner, reflects, slopes, _YES, i, begin, count)
            at = (y, single(scale.x_mm + scale.pitch_mm * position), pitch)
            rays = ray_ramps(scale, i + corner[0], position, count)
            if changes:
                _gain_block(w, scale.by_depth, i + corner[0], position, count)
            _begin_block(w, rays, at, leds, dark, curves, table, gloss, ONE, rest)
            for j in range(count):
                nx, ny = slopes.normal_x[i, begin + j], slopes.normal_y[i, begin + j]
                nz = -sqrt(_most(ONE - nx * nx - ny * ny, _TINY))
                _put(w, _NORMAL, j, (nx, ny, nz))
            if stretches:
                w[_STRETCHED * _B : (_STRETCHED + 1) * _B] = ONE
                _stretch_block(w, loss, rest)
            for j in range(count):
                parts = _left_over(w, j, dark, curves, table, gloss, rest)
                for part in range(5):
                    left[part, k, begin + j] = parts[part]


@_whole
def integrability_rows(first, last, slopes, depth, pitch_mm, size, uneven):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Compare slopes with the slopes of the depth that was integrated from them.

    Parameters
    ----------
    first, last : int
        Rows of `uneven`.
    slopes, depth, pitch_mm
        Solution of a region.
    size : int
        Nodes to a side of a square whose slopes are averaged.
    uneven : (2, squares down, squares across) float32
        Size of the mean difference, and of the mean slope, of every square; NaN where a node has
        less than two lights. Written.
    """
    weight, slope_x, slope_y = slopes.weight, slopes.slope_x, slopes.slope_y
    per_mm = ONE / pitch_mm
    for row in range(first, last):
        top = row * size
        bottom = min(top + size, depth.shape[0] - 1)
        for column in range(uneven.shape[2]):
            begin = column * size
            end = min(begin + size, depth.shape[1] - 1)
            is_known, off_x, off_y, sum_x, sum_y = True, ZERO, ZERO, ZERO, ZERO
            # Differences of the depth add up to those between the square's sides.
            for i in range(top, bottom):
                off_x += HALF * (slope_x[i, end] - slope_x[i, begin])
                off_x -= (depth[i, end] - depth[i, begin]) * per_mm
                for j in range(begin, end):
                    is_known &= weight[i, j] >= _ONE_HIDDEN
                    sum_x += slope_x[i, j]
                    sum_y += slope_y[i, j]
            for j in range(begin, end):
                off_y += HALF * (slope_y[bottom, j] - slope_y[top, j])
                off_y -= (depth[bottom, j] - depth[top, j]) * per_mm
            off_x, off_y = off_x + sum_x, off_y + sum_y
            count = single((bottom - top) * (end - begin))
            share = ONE / count if is_known and count > ZERO else single(np.nan)
            uneven[0, row, column] = share * sqrt(off_x * off_x + off_y * off_y)
            uneven[1, row, column] = share * sqrt(sum_x * sum_x + sum_y * sum_y)
