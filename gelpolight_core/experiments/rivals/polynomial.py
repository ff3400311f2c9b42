"""A ridge polynomial of third degree in colour ratio and position."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.experiments.rivals.samples import BallSamples, Map, Predict, require_pixels

Array = NDArray[np.float64]
DEGREE = 3
PENALTIES = tuple(10.0**power for power in range(-8, 0))
"""Tested ridge penalties, relative to the mean square of a term."""
BLOCK = 1 << 13
"""Pixels that are computed together: their terms stay in the cache."""
CLIP = 3.0
"""Inputs are clipped at this number of standard deviations: a polynomial does not extrapolate."""


def fit_polynomial(samples: BallSamples) -> Predict:
    """Fit slopes to powers of colour ratio and position.

    The penalty is the one with the smallest error on balls that were left out.

    Parameters
    ----------
    samples : BallSamples
        Of all presses.

    Raises
    ------
    InputError
        If the balls show too few pixels.
    """
    require_pixels(samples)
    inputs = np.concatenate([samples.change, samples.position_mm], axis=1)
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0) + np.float32(1e-9)
    sums = []
    for number in np.unique(samples.ball):
        mine = samples.ball == number
        terms = _terms((inputs[mine] - middle) / spread).astype(np.float64)
        slopes = samples.slopes[mine].astype(np.float64)
        sums.append((terms.T @ terms, terms.T @ slopes, float((slopes**2).sum())))
    weights = _fitted(sums, _best_penalty(sums)).astype(np.float32)

    def predict(change: Map, position_mm: Map) -> Map:
        slopes = np.empty((len(change), 2), np.float32)
        for begin in range(0, len(change), BLOCK):
            part = slice(begin, begin + BLOCK)
            given = (np.concatenate([change[part], position_mm[part]], axis=1) - middle) / spread
            slopes[part] = _terms(np.clip(given, -CLIP, CLIP)) @ weights
        return slopes

    return predict


def _terms(inputs: Map) -> Map:
    """Return all products of at most `DEGREE` inputs, (N, terms)."""
    columns = [np.ones(len(inputs), inputs.dtype)]
    made: dict[tuple[int, ...], Map] = {(): columns[0]}
    for degree in range(1, DEGREE + 1):
        for chosen in combinations_with_replacement(range(inputs.shape[1]), degree):
            made[chosen] = made[chosen[:-1]] * inputs[:, chosen[-1]]
            columns.append(made[chosen])
    return np.stack(columns, axis=1)


def _fitted(sums: list[tuple[Array, Array, float]], penalty: float) -> Array:
    gram = np.sum([g for g, _, _ in sums], axis=0)
    right = np.sum([c for _, c, _ in sums], axis=0)
    ridge = penalty * np.trace(gram) / len(gram)
    return np.asarray(np.linalg.solve(gram + ridge * np.eye(len(gram)), right))


def _best_penalty(sums: list[tuple[Array, Array, float]]) -> float:
    """Return the penalty with the least squared error on balls that were left out."""
    if len(sums) < 2:
        return PENALTIES[len(PENALTIES) // 2]

    def error(penalty: float) -> float:
        total = 0.0
        for k, (gram, right, square) in enumerate(sums):
            w = _fitted(sums[:k] + sums[k + 1 :], penalty)
            total += float(np.sum(w * (gram @ w)) - 2.0 * np.sum(w * right)) + square
        return total

    return min(PENALTIES, key=error)
