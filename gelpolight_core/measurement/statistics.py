"""Statistics of repeated measurements."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import ndtri

SD_ERROR = 0.25
"""Largest relative standard error of a standard deviation that is worth stating. With f degrees of
freedom it is 1 / sqrt(2 f) (GUM E.4.3): 25 % needs f = 8, nine repeats of one object."""
NEEDED_FREEDOM = math.ceil(0.5 / SD_ERROR**2)


def missing_repeats(freedom: int) -> int:
    """Return how many repeats a standard deviation with these degrees of freedom lacks."""
    return max(NEEDED_FREEDOM - freedom, 0)


def too_few_repeats(missing: int) -> str:
    """Return what to answer where repeats are missing, empty if there are enough."""
    return f"too few: {missing} more" if missing else ""


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of values of one quantity, NaN where there are too few.

    Attributes
    ----------
    count : int
        Number of finite values.
    mean_absolute, mean : float
        Mean of the absolute values and of the values.
    sd : float
        Standard deviation of a single value (n - 1).
    lowest, highest : float
        Extremes.
    """

    count: int
    mean_absolute: float
    mean: float
    sd: float
    lowest: float
    highest: float

    @property
    def spread(self) -> float:
        """Largest minus smallest. One value has none."""
        return self.highest - self.lowest if self.count > 1 else math.nan

    @property
    def missing(self) -> int:
        """How many values `sd` lacks to be worth stating."""
        return missing_repeats(self.count - 1)

    @property
    def repeatability(self) -> float:
        """Two measurements differ by less than this with a probability of 95 %.

        ISO 5725-6, 4.1: the repeatability limit, 2.8 standard deviations. The difference of two
        has sqrt(2) times the standard deviation of one.
        """
        return float(ndtri(0.975)) * math.sqrt(2.0) * self.sd

    def as_json(self, unit: str) -> dict[str, float | None]:
        """Return plain values, their names with a unit, None instead of NaN."""
        return {
            key if key == "count" else f"{key}_{unit}": finite_or_none(value)
            for key, value in asdict(self).items()
        }


def finite_or_none(value: float) -> float | None:
    """Return a number, or None for one that files do not hold."""
    return value if math.isfinite(value) else None


def statistics_of(values: Iterable[float]) -> Statistics:
    """Return the statistics of the finite values."""
    finite = np.array([value for value in values if math.isfinite(value)], np.float64)
    if finite.size == 0:
        return Statistics(0, *([math.nan] * 5))
    return Statistics(
        finite.size,
        float(np.abs(finite).mean()),
        float(finite.mean()),
        float(finite.std(ddof=1)) if finite.size > 1 else math.nan,
        float(finite.min()),
        float(finite.max()),
    )
