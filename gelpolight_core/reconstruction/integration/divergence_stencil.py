"""The compiled divergence of slopes: the sum over the edges of each node."""

from __future__ import annotations

from gelpolight_core.base import compiling

_part = compiling.part(fastmath={"nsz", "contract", "reassoc"})


@_part
def add_along_row(slope, start, weights, target):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Add the x part of the divergence of one line of slopes to one line."""
    columns = slope.shape[0]
    inner = max(columns - 4, 0)
    for at in range(columns - inner):
        # The few next to the border, on both sides of the inner ones.
        column = at if at < 2 else at + inner
        for tap in range(min(columns, 5)):
            target[column] += weights[column, tap] * slope[start[column] + tap]
    if inner > 0:
        a, b, c, d, e = weights[2]
        middle = target[2 : 2 + inner]
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
