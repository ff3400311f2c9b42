"""The compiled parts that read an image: block means, press over background, coarser scales."""

from __future__ import annotations

import numpy as np

from gelpolight_core.reconstruction.compiled import HALF, ONE, ZERO, part, single, whole
from gelpolight_core.reconstruction.near_light.structures import NOT_FINITE

BEYOND_FINITE = single(1.5)
_UNKNOWN_NOISE = single(1e6)


@whole
def block_means(first, last, raw, scale, block, means):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Average blocks of raw pixels, block rows `first` to `last`."""
    width = means.shape[1] * block * 3
    line = np.empty(width, np.float32)
    share = scale / single(block * block)
    for i in range(first, last):
        line[:] = 0.0
        for r in range(i * block, (i + 1) * block):
            source = raw[r]
            for c in range(width):
                line[c] += single(source[c])
        for j in range(means.shape[1]):
            at = 3 * block * j
            a, b, d = single(0.0), single(0.0), single(0.0)
            for c in range(block):
                a += line[at + 3 * c]
                b += line[at + 3 * c + 1]
                d += line[at + 3 * c + 2]
            means[i, j, 0], means[i, j, 1], means[i, j, 2] = a * share, b * share, d * share


@part
def _near(light, raw, k, c, r, fu, fv):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the bilinear light among four pixels, and the brightest of them."""
    p00, p01 = light[k, raw[r, c, k]], light[k, raw[r, c + 1, k]]
    p10, p11 = light[k, raw[r + 1, c, k]], light[k, raw[r + 1, c + 1, k]]
    upper, lower = p00 + fu * (p01 - p00), p10 + fu * (p11 - p10)
    return upper + fv * (lower - upper), max(max(p00, p01), max(p10, p11))


@part
def _wide(light, raw, k, c, r, fu, fv):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the bilinear light between averages of 2 x 2 pixels, and the brightest pixel."""
    c1, r1 = c + 1, r + 1
    c2, r2 = min(c + 2, raw.shape[1] - 1), min(r + 2, raw.shape[0] - 1)
    p00, p01, p02 = light[k, raw[r, c, k]], light[k, raw[r, c1, k]], light[k, raw[r, c2, k]]
    p10, p11, p12 = light[k, raw[r1, c, k]], light[k, raw[r1, c1, k]], light[k, raw[r1, c2, k]]
    p20, p21, p22 = light[k, raw[r2, c, k]], light[k, raw[r2, c1, k]], light[k, raw[r2, c2, k]]
    top = max(max(max(p00, p01), max(p02, p10)), max(max(p11, p12), max(p20, p21)))
    a, b = ONE - fu, ONE - fv
    seen = single(0.25) * (
        b * (a * p00 + p01 + fu * p02)
        + (a * p10 + p11 + fu * p12)
        + fv * (a * p20 + p21 + fu * p22)
    )
    return seen, max(top, p22)


@whole
def sample_rows(first, last, raw, light, limit, source, wide, sensor, kind, corner, image):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Compare a raw image with the background, rows `first` to `last` of a region.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The image.
    light : (3, levels) float32
        Linear light of every number.
    limit : float
        Light from which on a channel is saturated.
    source : tuple
        Raw pixel (u, v) and background (..., 3) of each node of the whole grid.
    wide : bool
        Whether a node is seen over 2 x 2 pixels; else bilinear among four.
    sensor : tuple
        Rows of the matrix that removes crosstalk, and the noise of press minus background (3).
    kind : (rows, columns) uint8
        Of the whole grid, as in `Scale`.
    corner : tuple
        Row and column of the region's first node.
    image : RatioImage
        Ratio, noise and marks are written.
    """
    u_px, v_px, background = source
    unmix, sd = sensor
    ratio, noise, marks = image.ratio, image.noise, image.marks
    height, width = raw.shape[0], raw.shape[1]
    back = HALF if wide else ZERO
    seen = np.empty(3, np.float32)
    for i in range(first, last):
        at = i + corner[0]
        for j in range(ratio.shape[2]):
            to = j + corner[1]
            if kind[at, to] != 2:
                for k in range(3):
                    ratio[k, i, j], noise[k, i, j] = ONE, _UNKNOWN_NOISE
                marks[i, j] = 0
                continue
            u = min(max(u_px[at, to] - back, ZERO), single(width - 1.001))
            v = min(max(v_px[at, to] - back, ZERO), single(height - 1.001))
            c, r = min(int(u), width - 2), min(int(v), height - 2)
            fu, fv = u - single(c), v - single(r)
            bits = 0
            for k in range(3):
                if wide:
                    seen[k], top = _wide(light, raw, k, c, r, fu, fv)
                else:
                    seen[k], top = _near(light, raw, k, c, r, fu, fv)
                if top >= limit:
                    bits |= 1 << k
                    if top > BEYOND_FINITE:
                        bits |= NOT_FINITE
            for k in range(3):
                own = unmix[k][0] * seen[0] + unmix[k][1] * seen[1] + unmix[k][2] * seen[2]
                gain = ONE / background[at, to, k]
                ratio[k, i, j] = own * gain
                noise[k, i, j] = sd[k] * gain
            marks[i, j] = bits


@part
def _finite_mean(fine, coarse, i, j):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the mean ratio of those of four nodes that are numbers; 1 where none is."""
    count = 0
    for r in range(2 * i, 2 * i + 2):
        for c in range(2 * j, 2 * j + 2):
            count += not fine.marks[r, c] & NOT_FINITE
    for k in range(3):
        total = ZERO
        for r in range(2 * i, 2 * i + 2):
            for c in range(2 * j, 2 * j + 2):
                if not fine.marks[r, c] & NOT_FINITE:
                    total += fine.ratio[k, r, c]
        coarse.ratio[k, i, j] = total / single(count) if count else ONE


@whole
def halve(first, last, fine, coarse):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Average an image over 2 x 2 nodes; a channel is saturated where most of them are.

    Nodes that are no number are left out of the average.
    """
    columns = coarse.marks.shape[1]
    quarter, eighth = single(0.25), single(0.125)
    for i in range(first, last):
        for k in range(3):
            a, b, out = fine.ratio[k, 2 * i], fine.ratio[k, 2 * i + 1], coarse.ratio[k, i]
            for j in range(columns):
                out[j] = quarter * ((a[2 * j] + a[2 * j + 1]) + (b[2 * j] + b[2 * j + 1]))
            a, b, out = fine.noise[k, 2 * i], fine.noise[k, 2 * i + 1], coarse.noise[k, i]
            for j in range(columns):
                out[j] = eighth * ((a[2 * j] + a[2 * j + 1]) + (b[2 * j] + b[2 * j + 1]))
        up, low, marks = fine.marks[2 * i], fine.marks[2 * i + 1], coarse.marks[i]
        for j in range(columns):
            p, q, r, s = up[2 * j], up[2 * j + 1], low[2 * j], low[2 * j + 1]
            marks[j] = (p & q & r) | (p & q & s) | (p & r & s) | (q & r & s)
            if (p | q | r | s) & NOT_FINITE:
                _finite_mean(fine, coarse, i, j)
