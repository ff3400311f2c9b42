"""Statistics of repeated measurements, and the change of a sensor's error over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray


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


@dataclass(frozen=True, slots=True)
class Drift:
    """The error of a sensor's measurements, oldest first.

    Attributes
    ----------
    times : tuple of datetime
        Times of the measurements, in UTC.
    times_s : (N,) float64
        The same in seconds since 1970, for a chart.
    error_percent : (N,) float64
        Measured minus true, in percent of the truth.
    quantities, shapes, calibration_ids : tuple of str
        Quantity, shape and calibration of each measurement.
    ids : tuple of int
        The measurements.
    """

    times: tuple[datetime, ...]
    times_s: NDArray[np.float64]
    error_percent: NDArray[np.float64]
    quantities: tuple[str, ...]
    shapes: tuple[str, ...]
    calibration_ids: tuple[str, ...]
    ids: tuple[int, ...]
