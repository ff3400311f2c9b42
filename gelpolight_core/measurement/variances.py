"""Variances of repeated measurements, within a position and between positions."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def variance_within(groups: Sequence[Sequence[float]]) -> float:
    """Return the pooled variance (mm**2) of repeats at one position; NaN without repeats.

    Parameters
    ----------
    groups : sequence of sequences of float
        Lengths (mm) by place, of one object or of several.
    """
    freedom = sum(len(values) - 1 for values in groups)
    squares = sum(float(np.var(values)) * len(values) for values in groups)
    return squares / freedom if freedom else math.nan


def variance_between(groups: Sequence[Sequence[float]], within: float) -> float:
    """Return the variance (mm**2) between positions; below 0 if there is none.

    Parameters
    ----------
    groups : sequence of sequences of float
        Lengths (mm) of one object, for two or more positions.
    within : float
        Variance (mm**2) of repeats at one place.
    """
    # The means of few repeats scatter, too; only the excess is due to the position.
    share = float(np.mean([1.0 / len(values) for values in groups]))
    return float(np.var([np.mean(values) for values in groups], ddof=1)) - share * within
