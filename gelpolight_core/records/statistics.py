"""Statistics of repeated measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of measurements of one quantity, in its unit.

    Attributes
    ----------
    n : int
        Number of measurements.
    mean : float
        Their mean.
    sd : float
        Standard deviation of a single measurement (n - 1); NaN for fewer than two.
    spread : float
        Largest minus smallest.
    repeatability : float
        Two measurements differ by less than this with a probability of 95 %; NaN for fewer than
        two.
    """

    n: int
    mean: float
    sd: float
    spread: float
    repeatability: float


# The difference of two has sqrt(2) times the standard deviation of one, and 95 % of a normal
# distribution lie within 1.96 of them.
REPEATABILITY_SDS = 1.959964 * math.sqrt(2.0)


def statistics_of(values: Sequence[float]) -> Statistics:
    """Return the statistics of repeated measurements.

    Parameters
    ----------
    values : sequence of float
        At least one.

    Raises
    ------
    ValueError
        If there is no value.

    References
    ----------
    ISO 5725-6, 4.1: the repeatability limit, 2.8 standard deviations.
    """
    if not len(values):
        raise ValueError("no measurements for statistics")
    array = np.asarray(values, np.float64)
    sd = float(np.std(array, ddof=1)) if array.size > 1 else math.nan
    return Statistics(
        int(array.size), float(array.mean()), sd, float(np.ptp(array)), REPEATABILITY_SDS * sd
    )
