"""Polynomials from change of colour and position to slope.

A term is a product of powers of the three channels' changes (degree 1 to 3) times a product of
powers of x and y (degree 0 to 3). There is no term without colour: no change means no slope.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.compiling import whole

COLOUR_DEGREE = 3
POSITION_DEGREE = 3
COLOUR_TERMS = tuple(
    sorted(
        (p for p in product(range(COLOUR_DEGREE + 1), repeat=3) if 0 < sum(p) <= COLOUR_DEGREE),
        key=lambda p: (sum(p), p),
    )
)
"""Powers of the three channels."""
POSITION_TERMS = tuple(
    (i, j) for i in range(POSITION_DEGREE + 1) for j in range(POSITION_DEGREE + 1 - i)
)
"""Powers of x and y, both -1..1 over the longer side."""
TERMS = len(COLOUR_TERMS) * len(POSITION_TERMS)


def position_axes(rows: int, columns: int) -> tuple[Float32Array, Float32Array]:
    """Return x of the columns and y of the rows, -1..1 over the longer side."""
    half = 0.5 * max(rows, columns)
    x = (np.arange(columns) - 0.5 * (columns - 1)) / half
    y = (np.arange(rows) - 0.5 * (rows - 1)) / half
    return x.astype(np.float32), y.astype(np.float32)


def design_rows(change: Float32Array, x: Float32Array, y: Float32Array) -> Float32Array:
    """Return the terms (N, `TERMS`) of N nodes.

    Parameters
    ----------
    change : (N, 3)
        Change of colour.
    x, y : (N,)
        Places, -1..1.
    """
    red, green, blue = (_powers(channel, COLOUR_DEGREE) for channel in change.T)
    along, across = _powers(x, POSITION_DEGREE), _powers(y, POSITION_DEGREE)
    colours = np.stack([red[i] * green[j] * blue[k] for i, j, k in COLOUR_TERMS], axis=1)
    positions = np.stack([along[i] * across[j] for i, j in POSITION_TERMS], axis=1)
    return np.asarray((colours[:, :, None] * positions[:, None, :]).reshape(len(x), -1), np.float32)


def _powers(values: Float32Array, most: int) -> list[Float32Array]:
    """Return the powers 0 to `most` of values."""
    powers = [np.ones_like(values)]
    for _ in range(most):
        powers.append(powers[-1] * values)
    return powers


def penalty(*, position_growth: float, colour_growth: float) -> Float64Array:
    """Return the ridge penalty of each term (`TERMS`,), 1 for the simplest.

    Parameters
    ----------
    position_growth, colour_growth : float
        Factor per degree in position, and per degree in colour above the first.
    """
    colour = np.array([sum(p) for p in COLOUR_TERMS], float)
    position = np.array([i + j for i, j in POSITION_TERMS], float)
    return np.asarray(
        (colour_growth ** (colour[:, None] - 1.0) * position_growth**position).ravel()
    )


def row_coefficients(coefficients: Float64Array, y: Float32Array) -> Float32Array:
    """Return the polynomials in x of each row: (rows, 2, colour terms, `POSITION_DEGREE` + 1).

    Parameters
    ----------
    coefficients : (TERMS, 2)
        Coefficients of both slopes.
    y : (rows,)
        Places of the rows, -1..1.
    """
    by_term = coefficients.reshape(len(COLOUR_TERMS), len(POSITION_TERMS), 2)
    rows = np.zeros((len(y), 2, len(COLOUR_TERMS), POSITION_DEGREE + 1))
    for index, (i, j) in enumerate(POSITION_TERMS):
        rows[..., i] += y.astype(np.float64)[:, None, None] ** j * by_term[:, index].T[None]
    return np.ascontiguousarray(rows, np.float32)


POWERS = np.array(COLOUR_TERMS, np.int64)


@whole(fastmath={"nsz", "arcp", "contract", "reassoc"})
def evaluate_rows(first, last, change, x, rows, powers, slope_x, slope_y):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the slopes of some rows of a frame.

    Parameters
    ----------
    first, last : int
        Rows.
    change : (rows, columns, 3) float32
        Change of colour.
    x : (columns,) float32
        Places of the columns.
    rows : (rows, 2, terms, 4) float32
        As :func:`row_coefficients` returns them.
    powers : (terms, 3) int
        Powers of the channels.
    slope_x, slope_y : (rows, columns) float32
        Written to.
    """
    columns = x.shape[0]
    terms = powers.shape[0]
    table = np.empty((3, 4, columns), np.float32)
    value = np.empty(columns, np.float32)
    for i in range(first, last):
        for k in range(3):
            for j in range(columns):
                c = change[i, j, k]
                table[k, 0, j] = np.float32(1.0)
                table[k, 1, j] = c
                table[k, 2, j] = c * c
                table[k, 3, j] = c * c * c
        out_x, out_y = slope_x[i], slope_y[i]
        out_x[:] = np.float32(0.0)
        out_y[:] = np.float32(0.0)
        for t in range(terms):
            r, g, b = table[0, powers[t, 0]], table[1, powers[t, 1]], table[2, powers[t, 2]]
            for j in range(columns):
                value[j] = r[j] * g[j] * b[j]
            a, e = rows[i, 0, t], rows[i, 1, t]
            a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
            e0, e1, e2, e3 = e[0], e[1], e[2], e[3]
            for j in range(columns):
                s = x[j]
                out_x[j] += value[j] * (a0 + s * (a1 + s * (a2 + s * a3)))
                out_y[j] += value[j] * (e0 + s * (e1 + s * (e2 + s * e3)))
