"""The compiled part of the paper's model: from pixels to slopes, many nodes at a time.

Blocks of nodes go through six small steps, each a loop without branches over planes of one small
array: that is what the compiler turns into wide instructions, and what stays in the nearest cache.
Only picking pixels and table entries goes node by node. Indices are those of plain loops: of an
index that is a sum, the compiler cannot know that it is not negative, and gives up.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from gelpolight_core.base import compiling
from gelpolight_core.base.membrane_masks import DARK_COSINE
from gelpolight_core.reconstruction.compiled import BLOCK, ONE, ZERO, single
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.integration.poisson import SLOPE_LIMIT

STATIC_PLANES = 5

_B = BLOCK
_int = np.int32
_LEAST_NZ = ONE / single(SLOPE_LIMIT)
_DARK = single(DARK_COSINE)
_OUTSIDE = np.uint8(Flag.OUTSIDE)
_F_OUTSIDE, _F_SATURATED = single(Flag.OUTSIDE), single(Flag.SATURATED)
_F_DARK, _F_FAR = single(Flag.DARK), single(Flag.EXTRAPOLATED)
_F_HIDDEN, _F_INVALID = single(Flag.NOT_OBSERVABLE), single(Flag.INVALID)
_BYTE, _HALF_WORD = np.uint32(255), np.uint64(32)

# Planes of the work array: place between pixels (2), light, then place in the table (3), brightest
# pixel, beyond the table, not a number; slopes (2), flags.
_WIDTHS = (2, 3, 1, 1, 1, 3)
_PLACE, _SEEN, _TOP, _FAR, _BAD, _OUT = (np.cumsum(_WIDTHS) - _WIDTHS).tolist()

_flags = {"nsz", "arcp", "contract"}
_part = compiling.part(fastmath=_flags, error_model="numpy")
_whole = compiling.whole(fastmath=_flags, error_model="numpy")


@_part
def _most(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a if a > b else b


@_part
def _pixels(i, block, static, width, height, w, pixel):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Note the upper left one of the four pixels about each node, and the place between them."""
    right, low = _int(width - 2), _int(height - 2)
    for j in range(_B):
        u, v = static[i, block, j], static[i, block, _B + j]
        c = max(min(_int(u), right), _int(0))
        r = max(min(_int(v), low), _int(0))
        pixel[j] = r * _int(width) + c
        w[j], w[_B + j] = u - single(c), v - single(r)


@_part
def _pick(pixel, pairs, below, words):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Fetch four pixels of a byte per channel: two neighbours at a time."""
    for j in range(_B):
        upper, lower = pairs[pixel[j]], pairs[pixel[j] + below]
        words[j] = np.uint32(upper)
        words[_B + j] = np.uint32(upper >> _HALF_WORD)
        words[2 * _B + j] = np.uint32(lower)
        words[3 * _B + j] = np.uint32(lower >> _HALF_WORD)


@_part
def _between(a, b, c, d, fu, fv):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the bilinear value among four pixels, and the brightest of them."""
    upper, lower = a + fu * (b - a), c + fu * (d - c)
    return upper + fv * (lower - upper), _most(_most(a, b), _most(c, d))


@_part
def _byte(words, at, shift):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return single(_int((words[at] >> np.uint32(shift)) & _BYTE))


@_part
def _byte_between(words, j, shift, fu, fv):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return _between(
        _byte(words, j, shift),
        _byte(words, _B + j, shift),
        _byte(words, 2 * _B + j, shift),
        _byte(words, 3 * _B + j, shift),
        fu,
        fv,
    )


@_part
def _resample_bytes(words, w):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for j in range(_B):
        fu, fv = w[j], w[_B + j]
        light0, top0 = _byte_between(words, j, 0, fu, fv)
        light1, top1 = _byte_between(words, j, 8, fu, fv)
        light2, top2 = _byte_between(words, j, 16, fu, fv)
        w[_SEEN * _B + j] = light0
        w[(_SEEN + 1) * _B + j] = light1
        w[(_SEEN + 2) * _B + j] = light2
        w[_TOP * _B + j] = _most(top0, _most(top1, top2))


@_part
def _resample_any(pixel, raw, right, below, w):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """As `_pick` and `_resample_bytes`, for pixels (pixels, 3) of any kind."""
    for j in range(_B):
        at = pixel[j]
        brightest = ZERO
        for k in range(3):
            light, top = _between(
                single(raw[at, k]),
                single(raw[at + right, k]),
                single(raw[at + below, k]),
                single(raw[at + below + right, k]),
                w[j],
                w[_B + j],
            )
            w[(_SEEN + k) * _B + j] = light
            brightest = _most(top, brightest)
        w[_TOP * _B + j] = brightest


@_part
def _resample(pixel, raw, pairs, right, below, words, w):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    if pairs is not None:
        _pick(pixel, pairs, below, words)
        _resample_bytes(words, w)
    else:
        _resample_any(pixel, raw, right, below, w)


@_part
def _limited(position, last):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return a position within the table, and flags for below or not a number, and beyond."""
    bad = not (position >= ZERO)
    position = ZERO if bad else position
    far = position > last
    return last if far else position, bad, far


@_part
def _positions(i, block, static, scale, size, w, entry):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Divide by light and factor (Eq. 7), and find the place in each channel's table."""
    last, top = single(size - 1), _int(size - 2)
    one, two = _int(size), _int(2 * size)
    for j in range(_B):
        a, bad0, far0 = _limited(w[_SEEN * _B + j] * static[i, block, 2 * _B + j] * scale[0], last)
        b, bad1, far1 = _limited(
            w[(_SEEN + 1) * _B + j] * static[i, block, 3 * _B + j] * scale[1], last
        )
        c, bad2, far2 = _limited(
            w[(_SEEN + 2) * _B + j] * static[i, block, 4 * _B + j] * scale[2], last
        )
        m, n, o = min(_int(a), top), min(_int(b), top), min(_int(c), top)
        entry[j], entry[_B + j], entry[2 * _B + j] = m, n + one, o + two
        w[_SEEN * _B + j] = a - single(m)
        w[(_SEEN + 1) * _B + j] = b - single(n)
        w[(_SEEN + 2) * _B + j] = c - single(o)
        w[_FAR * _B + j] = ONE if far0 | far1 | far2 else ZERO
        w[_BAD * _B + j] = ONE if bad0 | bad1 | bad2 else ZERO


@_part
def _look_up(entry, table, cosines):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Fetch entries of the tables: a cosine and the step to the next, half a word each."""
    for j in range(3 * _B):
        both = table[entry[j]]
        cosines[j] = np.uint32(both)
        cosines[3 * _B + j] = np.uint32(both >> _HALF_WORD)


@_part
def _cosine(w, cosines, k, j, coverage):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the cosine of a channel, and flags for dark and for beyond the data of the table."""
    cosine = cosines[k * _B + j] + w[(_SEEN + k) * _B + j] * cosines[(3 + k) * _B + j]
    dark = cosine < _DARK
    return cosine, dark, (not dark) & ((cosine < coverage[k][0]) | (cosine > coverage[k][1]))


@_part
def _normals(i, block, static, cosines, coverage, leds, limit, x_first, pitch, y, w):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Solve Eq. (10) by cross products of the vectors to the LEDs, and bring the normal to slopes.

    The products are straight lines in x; the determinant that they would be divided by leaves a
    slope as it is, and only its sign is needed.
    """
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = leds
    a1, b1, c1 = ay - y, by - y, cy - y
    a2, b2, c2 = a1 * a1 + az * az, b1 * b1 + bz * bz, c1 * c1 + cz * cz
    px, qx, rx = b1 * cz - bz * c1, c1 * az - cz * a1, a1 * bz - az * b1
    py0, qy0, ry0 = bz * cx - bx * cz, cz * ax - cx * az, az * bx - ax * bz
    py1, qy1, ry1 = cz - bz, az - cz, bz - az
    pz0, qz0, rz0 = bx * c1 - b1 * cx, cx * a1 - c1 * ax, ax * b1 - a1 * bx
    pz1, qz1, rz1 = b1 - c1, c1 - a1, a1 - b1
    for j in range(_B):
        ok = ONE if static[i, block, 2 * _B + j] > ZERO else ZERO
        ka, dark0, far0 = _cosine(w, cosines, 0, j, coverage)
        kb, dark1, far1 = _cosine(w, cosines, 1, j, coverage)
        kc, dark2, far2 = _cosine(w, cosines, 2, j, coverage)
        x = x_first + pitch * single(j)
        a0, b0, c0 = ax - x, bx - x, cx - x
        ka = ka * sqrt(a0 * a0 + a2)
        kb = kb * sqrt(b0 * b0 + b2)
        kc = kc * sqrt(c0 * c0 + c2)
        pz, qz, rz = pz0 + pz1 * x, qz0 + qz1 * x, rz0 + rz1 * x
        py = py0 + py1 * x
        whole = a0 * px + a1 * py + az * pz
        side = ONE if whole > ZERO else -ONE
        ka, kb, kc = side * ka, side * kb, side * kc
        nx = ka * px + kb * qx + kc * rx
        ny = ka * py + kb * (qy0 + qy1 * x) + kc * (ry0 + ry1 * x)
        nz = ka * pz + kb * qz + kc * rz
        size = sqrt(nx * nx + ny * ny + nz * nz)
        least = -_LEAST_NZ * size
        hidden = not (nz < least)
        nz = least if hidden else nz
        solved = size > ZERO
        short = ok / (nz if solved else ONE)
        saturated = w[_TOP * _B + j] >= limit
        far = far0 | far1 | far2 | (w[_FAR * _B + j] > ZERO)
        bad = (not solved) | (w[_BAD * _B + j] > ZERO)
        flag = (
            (_F_SATURATED if saturated else ZERO)
            + (_F_DARK if dark0 | dark1 | dark2 else ZERO)
            + (_F_FAR if far else ZERO)
            + (_F_HIDDEN if hidden else ZERO)
            + (_F_INVALID if bad else ZERO)
        )
        w[_OUT * _B + j] = nx * short
        w[(_OUT + 1) * _B + j] = ny * short
        w[(_OUT + 2) * _B + j] = ok * flag + (ONE - ok) * _F_OUTSIDE


@_part
def _put(w, plane, line, begin, count):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    part = line[begin : begin + count]
    if count == _B:
        for j in range(_B):
            part[j] = w[plane * _B + j]
    else:
        for j in range(count):
            part[j] = w[plane * _B + j]


@_part
def work_arrays():  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return what `solve_row` works in, made by its caller once for many rows."""
    return (
        np.zeros(sum(_WIDTHS) * _B, np.float32),
        np.zeros(_B, np.uint32),
        np.zeros(3 * _B, np.uint32),
        np.zeros(4 * _B, np.uint32),
        np.zeros(6 * _B, np.uint32),
    )


@_part
def solve_row(i, image, sensor, work, slope_x, slope_y, flags):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Solve row `i` into lines (columns,).

    `image` is: pixels (pixels, 3); of one of bytes two neighbours in each word (pixels,), else
    None; width, height; the value that counts as saturated. `sensor` is: `static` (rows, blocks,
    5 * 64) with u, v and the three gains; `lit` (rows, blocks), which blocks have any node of use;
    the table, a cosine and the step to the next in each word; from processed value to place in it
    (3); the cosines that it has data for (3, 2); the LEDs (3, 3); x of the first node, the pitch;
    y of the rows.
    """
    raw, pairs, width, height, limit = image
    static, lit, table, scale, coverage, leds, x_first, pitch, y_mm = sensor
    w, pixel, entry, words, cosines = work
    right = np.uint32(1 if width > 1 else 0)
    below = np.uint32(width if height > 1 else 0)
    entries, columns = table.shape[0] // 3, slope_x.shape[0]
    shares = cosines.view(np.float32)
    for block in range(static.shape[1]):
        begin = block * _B
        if lit[i, block]:
            _pixels(i, block, static, width, height, w, pixel)
            _resample(pixel, raw, pairs, right, below, words, w)
            _positions(i, block, static, scale, entries, w, entry)
            _look_up(entry, table, cosines)
            x = single(x_first + pitch * begin)
            step, y = single(pitch), y_mm[i]
            _normals(i, block, static, shares, coverage, leds, limit, x, step, y, w)
        else:
            w[_OUT * _B :] = ZERO
            w[(_OUT + 2) * _B : (_OUT + 3) * _B] = _F_OUTSIDE
        count = min(_B, columns - begin)
        _put(w, _OUT, slope_x, begin, count)
        _put(w, _OUT + 1, slope_y, begin, count)
        marks = flags[begin : begin + count]
        for j in range(count):
            marks[j] = np.uint8(_int(w[(_OUT + 2) * _B + j]))


@_whole
def blank_rows(first, last, flags, depth):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Set the depth of rows `first` to `last` to 0 where there is no membrane."""
    for i in range(first, last):
        for j in range(depth.shape[1]):
            depth[i, j] = ZERO if flags[i, j] & _OUTSIDE else depth[i, j]
