"""Ridge fit of the slope polynomial to ball presses.

Each press is reduced to its normal equations once. Leaving out a press, adding presses or changing
the ridge then only requires adding and solving small matrices.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.sensor.closed_sensor.colour_change import ColourChange
from gelpolight_core.sensor.closed_sensor.polynomial_terms import (
    design_rows,
    penalty,
    position_axes,
)

from .ball_contact import BallContact, offsets_from_centre

_Totals = tuple[Float64Array, Float64Array, int]

INSIDE = 0.95
"""Share of the contact radius in which the membrane follows the ball."""
FLAT_FROM = 1.4
"""Contact radii from the centre, and `FLAT_MARGIN` nodes, from which the membrane is flat."""
FLAT_MARGIN = 6.0
FLAT_WEIGHT = 0.1
STEP = 2
"""Every second node is used: the image is smooth over two."""
RIDGES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
TOWARDS_EARLIER = (1.0, 10.0, 100.0)
"""Further ones towards an earlier calibration: few presses of another gel may add nothing to it."""
GROWTHS = (1.0, 4.0, 16.0)
LOSS_CAP = 0.3
"""Largest mean squared slope error that a press can have in the sum."""


@dataclass(frozen=True, slots=True)
class PressNormalEquations:
    """Contribution of a press to the normal equations of the polynomial.

    Attributes
    ----------
    squares : (terms, terms)
        Sums over the terms, at nodes inside the contact and where the membrane is flat.
    products : (terms, 2)
        Sums over terms and slopes.
    inside : (terms, terms)
        As `squares`, inside the contact only.
    nodes : int
        Number of nodes inside the contact.
    energy : float
        Sum of the squared slopes.
    """

    squares: Float64Array
    products: Float64Array
    inside: Float64Array
    nodes: int
    energy: float


@dataclass(frozen=True, slots=True)
class RidgePenalty:
    """The ridge penalty.

    Attributes
    ----------
    strength : float
        Relative to the data.
    position_growth, colour_growth : float
        As for :func:`~gelpolight_core.sensor.closed_sensor.polynomial_terms.penalty`.
    towards : (terms, 2) or None
        Coefficients towards which it regularises, such as those of another gel; None: 0.
    """

    strength: float
    position_growth: float
    colour_growth: float
    towards: Float64Array | None = None

    @property
    def penalty(self) -> Float64Array:
        """Penalty of each term."""
        return self.strength * penalty(
            position_growth=self.position_growth, colour_growth=self.colour_growth
        )


FIRST_RIDGE = RidgePenalty(1e-3, 4.0, 4.0)


def press_sums(colours: ColourChange, ball: BallContact) -> PressNormalEquations:
    """Return the contribution of a press to the normal equations."""
    shape = colours.usable.shape
    from_x, from_y, rho = offsets_from_centre((shape[0], shape[1]), ball)
    subset = np.zeros(shape, np.bool_)
    subset[::STEP, ::STEP] = True
    inside = subset & colours.usable & (rho < INSIDE * ball.contact)
    flat = subset & colours.usable & (rho > FLAT_FROM * ball.contact + FLAT_MARGIN)
    sampled = np.flatnonzero(flat)
    sampled = sampled[:: max(sampled.size // 800, 1)]
    terms = _terms(colours.change, np.flatnonzero(inside))
    flat_terms = _terms(colours.change, sampled)
    slopes = ball.slopes(*(a[inside].astype(np.float64) for a in (from_x, from_y)))
    contact_squares = (terms.T @ terms).astype(np.float64)
    flat_squares = (flat_terms.T @ flat_terms).astype(np.float64)
    # The weight of the flat membrane is that of the contact times FLAT_WEIGHT squared.
    return PressNormalEquations(
        contact_squares + FLAT_WEIGHT**2 * flat_squares,
        (terms.T @ slopes.astype(np.float32)).astype(np.float64),
        contact_squares,
        len(terms),
        float((slopes**2).sum()),
    )


def _terms(change: Float32Array, index: NDArray[np.intp]) -> Float32Array:
    rows, columns = change.shape[:2]
    x, y = position_axes(rows, columns)
    row, column = np.divmod(index, columns)
    return design_rows(change[row, column], x[column], y[row])


def solve_ridge(sums: Iterable[PressNormalEquations], ridge: RidgePenalty) -> Float64Array:
    """Return the coefficients (terms, 2).

    Parameters
    ----------
    sums : iterable of PressNormalEquations
        Sums of the presses to be fitted, at least one.
    ridge : RidgePenalty
        The penalty.
    """
    return _solved(*_totals(list(sums)), ridge)


def _solved(
    squares: Float64Array, products: Float64Array, nodes: int, ridge: RidgePenalty
) -> Float64Array:
    # Each term in units of its own size, so that the ridge has the same effect on all.
    size = np.sqrt(np.diag(squares) / max(nodes, 1)) + 1e-9
    scaled = squares / size[:, None] / size[None, :]
    penalty = max(nodes, 1) * ridge.penalty
    moments = products / size[:, None]
    if ridge.towards is not None:
        moments = moments + penalty[:, None] * (ridge.towards * size[:, None])
    scaled[np.diag_indices_from(scaled)] += penalty
    solution = scipy.linalg.solve(scaled, moments, assume_a="pos", check_finite=False)
    return np.asarray(solution / size[:, None])


def mean_squared_error(press: PressNormalEquations, coefficients: Float64Array) -> float:
    """Return the mean squared error of a press's slopes, both components together."""
    fitted = (coefficients * (press.inside @ coefficients)).sum()
    total = float(fitted) - 2.0 * float((coefficients * press.products).sum()) + press.energy
    return max(total, 0.0) / max(press.nodes, 1)


def squared_loss(
    presses: Sequence[PressNormalEquations], coefficients: Sequence[Float64Array]
) -> float:
    """Return the sum of the mean squared errors of presses, each with its coefficients."""
    pairs = zip(presses, coefficients, strict=True)
    return sum(min(mean_squared_error(press, fitted), LOSS_CAP) for press, fitted in pairs)


def leave_one_out_fits(
    sums: Sequence[PressNormalEquations], ridge: RidgePenalty
) -> list[Float64Array]:
    """Return for each press the coefficients of a fit without it."""
    coefficients: list[Float64Array] = [np.empty(0)] * len(sums)
    for fold, others in _without_folds(sums):
        fitted = _solved(*others, ridge)
        for i in fold:
            coefficients[i] = fitted
    return coefficients


def _without_folds(sums: Sequence[PressNormalEquations]) -> list[tuple[list[int], _Totals]]:
    """Return each group of presses that is left out, with the totals of the others."""
    totals, parts = _totals(sums), []
    number = min(len(sums), 8)  # groups; more would only take more time
    for fold in (list(range(first, len(sums), number)) for first in range(number)):
        squares, products, nodes = _totals([sums[i] for i in fold])
        parts.append((fold, (totals[0] - squares, totals[1] - products, totals[2] - nodes)))
    return parts


def _totals(sums: Sequence[PressNormalEquations]) -> _Totals:
    squares = np.sum([press.squares for press in sums], axis=0)
    products = np.sum([press.products for press in sums], axis=0)
    return squares, products, sum(press.nodes for press in sums)


def choose_ridge(
    sums: Sequence[PressNormalEquations], towards: Float64Array | None
) -> RidgePenalty:
    """Return the ridge with the smallest error of presses that were left out.

    One press leaves none to compare: it hardly moves an earlier calibration.

    Parameters
    ----------
    sums : sequence of PressNormalEquations
        Sums of all presses.
    towards : (terms, 2) or None
        As of :class:`RidgePenalty`.
    """
    if len(sums) == 1:
        return replace(FIRST_RIDGE, strength=TOWARDS_EARLIER[-1], towards=towards)
    parts = _without_folds(sums)
    best, min_loss = replace(FIRST_RIDGE, towards=towards), np.inf
    strengths = RIDGES if towards is None else (*RIDGES, *TOWARDS_EARLIER)
    for growths in product(GROWTHS, GROWTHS):
        for strength in strengths:
            ridge = RidgePenalty(strength, *growths, towards)
            loss = 0.0
            for fold, others in parts:
                coefficients = _solved(*others, ridge)
                loss += squared_loss([sums[i] for i in fold], [coefficients] * len(fold))
                if loss > min_loss:
                    break
            if loss < min_loss:
                best, min_loss = ridge, loss
    return best


def learning_curve(
    sums: Sequence[PressNormalEquations], ridge: RidgePenalty
) -> tuple[tuple[int, float], ...]:
    """Return the error of the other presses for fits with few, some and most of the presses.

    Parameters
    ----------
    sums : sequence of PressNormalEquations
        Sums of all presses.
    ridge : RidgePenalty
        As chosen with all; the fits start from 0.

    Returns
    -------
    tuple of (int, float)
        Number of balls, root mean square slope error (both components together).
    """
    count, ridge = len(sums), replace(ridge, towards=None)
    curve = []
    for number in (3, 5, 8, 12, 16, 24, 32, 48):
        if number > count - 2:
            break
        errors = []
        for first in range(3):
            used = {round(i) for i in np.linspace(first % 2, count - 1 - first // 2, number)}
            fitted = solve_ridge([sums[i] for i in used], ridge)
            errors += [mean_squared_error(sums[i], fitted) for i in range(count) if i not in used]
        curve.append((number, float(np.sqrt(np.median(errors)))))
    return tuple(curve)
