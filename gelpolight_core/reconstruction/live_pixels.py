"""The compiled parts of the planned reconstruction about pixels: look, sample, place, show."""

from __future__ import annotations

import numba
import numpy as np

_whole = numba.njit(nogil=True, fastmath={"nsz", "arcp", "contract"}, cache=True)
_single = np.float32
_HALF, _1 = _single(0.5), _single(1.0)
PLACE_ROUNDS = 14
PLACED = 0.01
FOLDED = 0.55


@_whole
def block_means(first, last, raw, scale, block, means):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Average blocks of raw pixels, block rows `first` to `last`."""
    width = means.shape[1] * block * 3
    line = np.empty(width, np.float32)
    share = scale / _single(block * block)
    for i in range(first, last):
        line[:] = 0.0
        for r in range(i * block, (i + 1) * block):
            source = raw[r]
            for c in range(width):
                line[c] += _single(source[c])
        for j in range(means.shape[1]):
            at = 3 * block * j
            a, b, d = _single(0.0), _single(0.0), _single(0.0)
            for c in range(block):
                a += line[at + 3 * c]
                b += line[at + 3 * c + 1]
                d += line[at + 3 * c + 2]
            means[i, j, 0], means[i, j, 1], means[i, j, 2] = a * share, b * share, d * share


@_whole
def sample_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, raw, light, limit, u_px, v_px, unmix, gain, kind, corner, ratio, saturated
):
    """Compare a raw picture with the background, over the 2 x 2 pixels about each node.

    Bilinear between averages of 2 x 2 pixels, in linear light, crosstalk removed.
    """
    height, width = raw.shape[0], raw.shape[1]
    seen = np.empty(3, np.float32)
    for i in range(first, last):
        at = i + corner[0]
        for j in range(ratio.shape[2]):
            to = j + corner[1]
            if kind[at, to] != 2:
                for k in range(3):
                    ratio[k, i, j] = _1
                saturated[i, j] = 0
                continue
            u = min(max(u_px[at, to] - _HALF, _single(0.0)), _single(width - 2.001))
            v = min(max(v_px[at, to] - _HALF, _single(0.0)), _single(height - 2.001))
            c, r = int(u), int(v)
            fu, fv = u - _single(c), v - _single(r)
            c1, r1, c2, r2 = c + 1, r + 1, min(c + 2, width - 1), min(r + 2, height - 1)
            a, b = _1 - fu, _1 - fv
            bits = 0
            for k in range(3):
                p00, p01, p02 = (
                    light[k, raw[r, c, k]],
                    light[k, raw[r, c1, k]],
                    light[k, raw[r, c2, k]],
                )
                p10, p11, p12 = (
                    light[k, raw[r1, c, k]],
                    light[k, raw[r1, c1, k]],
                    light[k, raw[r1, c2, k]],
                )
                p20, p21, p22 = (
                    light[k, raw[r2, c, k]],
                    light[k, raw[r2, c1, k]],
                    light[k, raw[r2, c2, k]],
                )
                top = max(max(max(p00, p01), max(p02, p10)), max(max(p11, p12), max(p20, p21)))
                if max(top, p22) >= limit:
                    bits |= 1 << k
                seen[k] = _single(0.25) * (
                    b * (a * p00 + p01 + fu * p02)
                    + (a * p10 + p11 + fu * p12)
                    + fv * (a * p20 + p21 + fu * p22)
                )
            for k in range(3):
                own = unmix[k][0] * seen[0] + unmix[k][1] * seen[1] + unmix[k][2] * seen[2]
                ratio[k, i, j] = own * gain[k, at, to]
            saturated[i, j] = bits


@_whole
def halve(ratio, saturated, coarse, coarse_saturated):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Average ratios over 2 x 2 nodes; a channel is saturated where most of them are."""
    rows, columns = coarse_saturated.shape
    quarter = _single(0.25)
    for i in range(rows):
        for k in range(3):
            a, b, out = ratio[k, 2 * i], ratio[k, 2 * i + 1], coarse[k, i]
            for j in range(columns):
                out[j] = quarter * ((a[2 * j] + a[2 * j + 1]) + (b[2 * j] + b[2 * j + 1]))
        up, low, marks = saturated[2 * i], saturated[2 * i + 1], coarse_saturated[i]
        for j in range(columns):
            p, q, r, s = up[2 * j], up[2 * j + 1], low[2 * j], low[2 * j + 1]
            marks[j] = (p & q & r) | (p & q & s) | (p & r & s) | (q & r & s)


@numba.njit(nogil=True, fastmath={"nsz", "arcp", "contract"}, cache=True, forceinline=True)
def _between(values, c, r, fc, fr):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    top = values[r, c] + fc * (values[r, c + 1] - values[r, c])
    low = values[r + 1, c] + fc * (values[r + 1, c + 1] - values[r + 1, c])
    return (
        top + fr * (low - top),
        (values[r, c + 1] - values[r, c]) * (_1 - fr)
        + (values[r + 1, c + 1] - values[r + 1, c]) * fr,
        low - top,
    )


@_whole
def place_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, depth, static, corner, per_pitch, flags, hidden, placed, placed_flags, place
):
    """Find the ray that sees each true position, and the depth there.

    The ray of node j sees the surface at j + depth * drift: Newton's steps on the bilinear depth,
    and half steps of the fixed point where the surface folds.
    """
    rows, columns = depth.shape
    for i in range(first, last):
        for j in range(columns):
            wx = static[6, i + corner[0], j + corner[1]] * per_pitch
            wy = static[7, i + corner[0], j + corner[1]] * per_pitch
            wxx, wyx = (
                static[8, i + corner[0], j + corner[1]],
                static[9, i + corner[0], j + corner[1]],
            )
            wxy, wyy = (
                static[10, i + corner[0], j + corner[1]],
                static[11, i + corner[0], j + corner[1]],
            )
            d = depth[i, j]
            c, r = _single(j), _single(i)
            x, y = c - d * wx, r - d * wy
            missed = _single(0.0)
            n, m = j, i
            for step in range(PLACE_ROUNDS):
                x = min(max(x, _single(0.0)), _single(columns - 1))
                y = min(max(y, _single(0.0)), _single(rows - 1))
                n, m = min(int(x), columns - 2), min(int(y), rows - 2)
                d, by_x, by_y = _between(depth, n, m, x - _single(n), y - _single(m))
                off_x, off_y = x - c, y - r
                ex = off_x + d * (wx + wxx * off_x + wxy * off_y)
                ey = off_y + d * (wy + wyx * off_x + wyy * off_y)
                missed = max(abs(ex), abs(ey))
                if missed < PLACED:
                    break
                det = _1 + by_x * wx + by_y * wy
                if step < 5 and det > _single(0.3):
                    along = (by_x * ex + by_y * ey) / det
                    x -= ex - along * wx
                    y -= ey - along * wy
                else:
                    x -= _HALF * ex
                    y -= _HALF * ey
            placed[i, j] = d
            near = flags[min(int(y + _HALF), rows - 1), min(int(x + _HALF), columns - 1)]
            placed_flags[i, j] = near | (hidden if missed > FOLDED else 0)
            place[0, i, j], place[1, i, j] = x, y


@_whole
def show_depth(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, placed, placed_flags, factor, corner, outside, depth, flags
):
    """Bring depth and flags from a coarser region to rows of the whole grid, bilinear."""
    rows, columns = placed.shape
    line = np.empty(columns, np.float32)
    share = _1 / _single(factor)
    for i in range(first, last):
        y = (_single(i) + _HALF) * share - _HALF
        m = min(max(int(np.floor(y)), 0), rows - 1)
        m1 = min(m + 1, rows - 1)
        f = min(max(y - _single(m), _single(0.0)), _1)
        a, b = placed[m], placed[m1]
        for j in range(columns):
            line[j] = a[j] + f * (b[j] - a[j])
        marks, source = flags[corner[0] + i], placed_flags[i // factor]
        out = depth[corner[0] + i]
        for n in range(columns):
            left, right = line[max(n - 1, 0)], line[min(n + 1, columns - 1)]
            here = line[n]
            mark = source[n] & ~outside
            for k in range(factor):
                at = corner[1] + n * factor + k
                t = (_single(k) + _HALF) * share - _HALF
                value = here + t * (right - here) if t > 0.0 else here + t * (here - left)
                blind = marks[at] & outside
                out[at] = value if blind == 0 else _single(0.0)
                marks[at] = marks[at] | mark


@_whole
def show_normals(first, last, normal_x, normal_y, place, factor, corner, normals):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Bring normals to their true positions on rows of the whole grid."""
    rows, columns = normal_x.shape
    share = _1 / _single(factor)
    for i in range(first, last):
        y = min(max((_single(i) + _HALF) * share - _HALF, _single(0.0)), _single(rows - 1))
        m = min(int(y), rows - 2)
        for j in range(columns * factor):
            x = min(max((_single(j) + _HALF) * share - _HALF, _single(0.0)), _single(columns - 1))
            n = min(int(x), columns - 2)
            u = _between(place[0], n, m, x - _single(n), y - _single(m))[0]
            v = _between(place[1], n, m, x - _single(n), y - _single(m))[0]
            c, r = min(int(u), columns - 2), min(int(v), rows - 2)
            nx = _between(normal_x, c, r, u - _single(c), v - _single(r))[0]
            ny = _between(normal_y, c, r, u - _single(c), v - _single(r))[0]
            to = normals[corner[0] + i, corner[1] + j]
            to[0], to[1] = nx, ny
            to[2] = -np.sqrt(max(_1 - nx * nx - ny * ny, _single(0.0)))
