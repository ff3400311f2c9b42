"""Expected improvement by further presses with their best position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gelpolight_core.arrays import Mask
from gelpolight_core.in_place.ball import Ball
from gelpolight_core.in_place.fit import PressSums, Ridge, mean_squared_error, solve
from gelpolight_core.reconstruction.in_place.grid import WorkingGrid


def learning_curve(sums: Sequence[PressSums], ridge: Ridge) -> tuple[tuple[int, float], ...]:
    """Return the error of the other presses for fits with few, some and most of the presses.

    Parameters
    ----------
    sums : sequence of PressSums
        Sums of all presses.
    ridge : Ridge
        As chosen with all.

    Returns
    -------
    tuple of (int, float)
        Number of balls, root mean square slope error (both components together).
    """
    count = len(sums)
    curve = []
    for number in (3, 5, 8, 12, 16, 24, 32, 48):
        if number > count - 2:
            break
        errors = []
        for first in range(3):
            used = {round(i) for i in np.linspace(first % 2, count - 1 - first // 2, number)}
            fitted = solve([sums[i] for i in used], ridge)
            errors += [mean_squared_error(sums[i], fitted) for i in range(count) if i not in used]
        curve.append((number, float(np.sqrt(np.median(errors)))))
    return tuple(curve)


def next_position(balls: Sequence[Ball], grid: WorkingGrid, lit: Mask) -> tuple[float, float]:
    """Return the position (x, y) in mm farthest from all presses, one contact inside the border.

    Parameters
    ----------
    balls : sequence of Ball
        The presses.
    grid : WorkingGrid
        Nodes and scale.
    lit : (rows, columns) bool
        Visible part of the membrane.
    """
    rows, columns = grid.shape
    contact = float(np.median([ball.contact for ball in balls]))
    margin = min(contact, 0.3 * min(rows, columns))
    x, y = np.meshgrid(
        np.linspace(margin, columns - 1 - margin, 24), np.linspace(margin, rows - 1 - margin, 24)
    )
    nearest = np.min([np.hypot(x - ball.x, y - ball.y) for ball in balls], axis=0)
    nearest[~lit[y.astype(np.intp), x.astype(np.intp)]] = -1.0
    best = np.unravel_index(int(nearest.argmax()), nearest.shape)
    return (
        float(np.interp(x[best], np.arange(columns), grid.x_mm)),
        float(np.interp(y[best], np.arange(rows), grid.y_mm)),
    )
