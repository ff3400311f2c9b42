"""The compiled divergence of slopes: the sum over the edges of each node."""

from __future__ import annotations

import numpy as np

from gelpolight_core.base import compiling

_flags = {"nsz", "contract", "reassoc"}
_whole, _part = compiling.whole(fastmath=_flags), compiling.part(fastmath=_flags)


@_part
def _sound(source, limit):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return whether all slopes of a line are finite and within the limit."""
    sound = source.dtype.type(0)
    one, none = source.dtype.type(1), source.dtype.type(0)
    for column in range(source.shape[0]):
        sound += one if abs(source[column]) <= limit else none
    return sound == source.shape[0]


@_part
def _clean(source, target, limit):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Copy a line of slopes with non-finite ones as 0 and steep ones clipped, and count both."""
    bad, clipped = 0, 0
    if _sound(source, limit):
        for column in range(source.shape[0]):
            target[column] = source[column]
        return bad, clipped
    for column in range(source.shape[0]):
        value = source[column]
        finite = value - value == 0
        bad += not finite
        clipped += finite and abs(value) > limit
        target[column] = min(max(value, -limit), limit) if finite else source.dtype.type(0)
    return bad, clipped


@_part
def add_along_row(slope, start, weights, left, target):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Add the x part of the divergence of one line of slopes to one padded line."""
    columns = slope.shape[0]
    inner = max(columns - 4, 0)
    end = min(left + columns + 1, target.shape[0])
    before = min(left + 2, end)
    for at in range(end - inner):
        # The few next to the border, on both sides of the inner ones.
        column = at if at < before else at + inner
        if column < left - 1:
            continue
        for tap in range(min(columns, 5)):
            target[column] += weights[column, tap] * slope[start[column] + tap]
    if inner > 0:
        a, b, c, d, e = weights[left + 2]
        middle = target[left + 2 : left + 2 + inner]
        for k in range(inner):
            middle[k] += (
                a * slope[k]
                + b * slope[k + 1]
                + c * slope[k + 2]
                + d * slope[k + 3]
                + e * slope[k + 4]
            )


@_part
def add_down(ring, begin, weights, target):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Add the y part of the divergence of one line, from five lines of slopes in a ring."""
    a, b, c, d, e = weights
    r0, r1, r2 = ring[begin % 5], ring[(begin + 1) % 5], ring[(begin + 2) % 5]
    r3, r4 = ring[(begin + 3) % 5], ring[(begin + 4) % 5]
    for k in range(target.shape[0]):
        target[k] += a * r0[k] + b * r1[k] + c * r2[k] + d * r3[k] + e * r4[k]


@_whole
def divergence_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
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
    faults[first:last] = 0
    for line in range(first, last):
        field[line] = 0
        if not (top - 1 <= line <= top + rows):
            continue
        begin = start_y[line]
        if loaded < 0:
            loaded = begin
        while loaded < min(begin + 5, rows):
            bad, clipped = _clean(slope_y[loaded], ring[loaded % 5], limit)
            # Lines that two threads read are counted by one.
            if first <= loaded + top < last:
                faults[loaded + top, 0] += bad
                faults[loaded + top, 1] += clipped
            loaded += 1
        add_down(ring, begin, weight_y[line], field[line][left : left + columns])
        if top <= line < top + rows:
            bad, clipped = _clean(slope_x[line - top], line_x, limit)
            faults[line, 0] += bad
            faults[line, 1] += clipped
            add_along_row(line_x, start_x, weight_x, left, field[line])
