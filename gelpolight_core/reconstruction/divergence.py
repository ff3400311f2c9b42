"""The compiled divergence of slopes: what each node's edges bring to it."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def _clean(source, target, limit):  # type: ignore[no-untyped-def]
    """Copy a line of slopes, non-finite ones as 0, steep ones clipped; count both."""
    bad = np.int32(0)
    clipped = np.int32(0)
    for column in range(source.shape[0]):
        value = source[column]
        finite = value - value == 0
        bad += not finite
        clipped += finite and abs(value) > limit
        target[column] = min(max(value, -limit), limit) if finite else source.dtype.type(0)
    return bad, clipped


@njit(cache=True, nogil=True)
def _faults(source, limit):  # type: ignore[no-untyped-def]
    """Count what is not finite and what is too steep in a line of slopes."""
    bad = np.int32(0)
    clipped = np.int32(0)
    for column in range(source.shape[0]):
        value = source[column]
        finite = value - value == 0
        bad += not finite
        clipped += finite and abs(value) > limit
    return bad, clipped


@njit(cache=True, nogil=True)
def _add_along_row(slope, start, weights, left, target):  # type: ignore[no-untyped-def]
    """Add the x part of the divergence of one line of slopes to one padded line."""
    columns = slope.shape[0]
    inner = max(columns - 4, 0)
    for column in range(max(left - 1, 0), min(left + columns + 1, target.shape[0])):
        if left + 2 <= column < left + 2 + inner:
            continue
        for tap in range(min(columns, 5)):
            target[column] += weights[column, tap] * slope[start[column] + tap]
    if inner > 0:
        a, b, c, d, e = weights[left + 2]
        middle = target[left + 2 : left + 2 + inner]
        for k in range(inner):
            middle[k] += (
                a * slope[k] + b * slope[k + 1] + c * slope[k + 2]
                + d * slope[k + 3] + e * slope[k + 4]
            )  # fmt: skip


@njit(cache=True, nogil=True)
def divergence_rows(  # type: ignore[no-untyped-def]
    first,
    last,
    slope_x,
    slope_y,
    start_x,
    weight_x,
    start_y,
    weight_y,
    top,
    left,
    limit,
    field,
    faults,
):
    """Write lines `first` to `last` of the divergence on the padded grid.

    Slopes are cleaned on the way; how many were not finite and how many clipped is noted in
    `faults` (lines, 2). Five cleaned lines of slope_y are kept in a ring, in the cache.
    """
    rows, columns = slope_x.shape
    ring = np.zeros((5, columns), slope_x.dtype)
    line_x = np.empty(columns, slope_x.dtype)
    loaded = -1
    for line in range(first, last):
        field[line] = 0
        faults[line] = 0
        if not (top - 1 <= line <= top + rows):
            continue
        begin = start_y[line]
        if loaded < 0:
            loaded = begin
        while loaded < min(begin + 5, rows):
            _clean(slope_y[loaded], ring[loaded % 5], limit)
            loaded += 1
        a, b, c, d, e = weight_y[line]
        r0, r1, r2 = ring[begin % 5], ring[(begin + 1) % 5], ring[(begin + 2) % 5]
        r3, r4 = ring[(begin + 3) % 5], ring[(begin + 4) % 5]
        target = field[line, left : left + columns]
        for k in range(columns):
            target[k] = a * r0[k] + b * r1[k] + c * r2[k] + d * r3[k] + e * r4[k]
        if top <= line < top + rows:
            bad, clipped = _clean(slope_x[line - top], line_x, limit)
            _add_along_row(line_x, start_x, weight_x, left, field[line])
            more = _faults(slope_y[line - top], limit)
            faults[line, 0], faults[line, 1] = bad + more[0], clipped + more[1]
