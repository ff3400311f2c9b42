"""How soon the drift of one LED is reported, and how often one that is none.

``python -m tests.studies.drift [YEARS]`` simulates the daily light of three LEDs of a sensor. Its
scatter from day to day is :data:`SCATTER_PERCENT` for each, or wanders (autocorrelation 0.5).

1,000 years: 6 false alarms, at most one in a year; 74 and at most two where the light wanders. A
drift of 1 % a month after a week or more without one is reported after 8 to 11 days in the median,
in 99.5 % of 200 trials within two weeks; one that begins with the calibration after 14 days, in
65 % within two weeks, at the latest after 20.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.lab.drift import LEAST_DAYS, drifts
from gelpolight_core.lab.trend import MONTH_DAYS
from tests.studies.presses import show

SCATTER_PERCENT, WITHIN_DAY_PERCENT = 0.1, 0.02
MONTHLY_PERCENT = 1.0
DAYS = 365


def light(
    rng: np.random.Generator, days: int, *, stable: int, monthly: float, wander: float = 0.0
) -> NDArray[np.float64]:
    """Return the light (days, 3) in percent; the red LED drifts after `stable` days."""
    new = rng.normal(0.0, SCATTER_PERCENT * np.sqrt(1.0 - wander**2), (days, 3))
    new[0] /= np.sqrt(1.0 - wander**2)
    scatter = [new[0]]
    for step in new[1:]:
        scatter.append(wander * scatter[-1] + step)
    drift = monthly / MONTH_DAYS * np.maximum(np.arange(days) - stable, 0.0)
    seen: NDArray[np.float64] = np.array(scatter) + drift[:, None] * (1.0, 0.0, 0.0)
    return seen


def alarms(values: NDArray[np.float64]) -> Iterator[NDArray[np.bool_]]:
    """Yield on each day, from the first test on, which values (days, n) are reported."""
    for count in range(LEAST_DAYS, len(values) + 1):
        lines = drifts(
            np.arange(count, dtype=np.float64), values[:count], np.full(count, WITHIN_DAY_PERCENT)
        )
        yield np.array([line.alarm for line in lines])


def false_alarms(years: int, wander: float = 0.0) -> NDArray[np.int64]:
    """Return the number of alarms that begin in each of some years without a drift."""
    counts = []
    for year in range(years):
        rng = np.random.default_rng([1, year])
        shown = np.array(list(alarms(light(rng, DAYS, stable=DAYS, monthly=0.0, wander=wander))))
        begun = shown.any(axis=1).astype(int)
        counts.append(int((np.diff(begun, prepend=0) > 0).sum()))
    return np.array(counts)


def days_to_alarm(trials: int, stable: int, wander: float = 0.0) -> NDArray[np.int64]:
    """Return after how many days of drift the red LED is reported, after some stable days."""
    found = []
    for trial in range(trials):
        rng = np.random.default_rng([2, stable, trial])
        values = light(rng, stable + 60, stable=stable, monthly=MONTHLY_PERCENT, wander=wander)
        first = next((day for day, on in enumerate(alarms(values), LEAST_DAYS) if on[0]), 10**6)
        found.append(first - 1 - stable)
    return np.array(found)


def main() -> None:
    """Print both."""
    years = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    for wander in (0.0, 0.5):
        counts = false_alarms(years, wander)
        most, total = int(counts.max()), int(counts.sum())
        show([{"wander": wander, "years": years, "alarms": total, "most in a year": most}])
        for stable in (0, 7, 14, 30, 90):
            days = days_to_alarm(200, stable, wander)
            within = float((days <= 14).mean())
            row = {"stable days": stable, "median days": float(np.median(days))}
            show([row | {"worst": int(days.max()), "within two weeks": within}])


if __name__ == "__main__":
    main()
