"""Drift of a sensor: a straight line from an unknown day on, and whether chance explains it.

A value is constant, and from one of several days on it changes by the same amount every day. All
of these days are tried whenever there is a new value. The level of the test is the stated rate of
false alarms divided by the number of tests of a year (Bonferroni); this rate is the only number
that was chosen. A value that changes at random from day to day is distinguished from a drift by
the correlation of its residuals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

Array = NDArray[np.float64]
FALSE_ALARMS_A_YEAR = 0.1
"""Of a sensor whose values are constant, at most: even among 1,000 years none has two."""
DAYS_A_YEAR = 365
QUANTITIES = 8
"""Values of a sensor that are followed: light of three channels, shift along two axes, blur, and
errors of size and height in a validation."""
LEAST_DAYS = 4
"""Days with values from which on a line and its scatter are known."""
CONFIDENCE = 0.95
"""Of the earliest and the latest day."""
WANDER = 0.99
"""Correlation of successive days, at most."""
LEAST_SD = 1e-9
"""Standard deviation of a value that is stated without one: its scatter alone counts."""


@dataclass(frozen=True, slots=True)
class Line:
    """A value that is constant up to a day, and then changes along a straight line.

    Attributes
    ----------
    start_day, last_day : float
        The day from which on it changes, and that of the last value.
    level, per_day : float
        The constant, and the change of each day.
    covariance : (2, 2) float64
        Of the two.
    freedom : float
        Degrees of freedom of the scatter that is in the covariance.
    alarm : bool
        Whether it is a drift that chance does not explain.
    """

    start_day: float
    last_day: float
    level: float
    per_day: float
    covariance: Array
    freedom: float
    alarm: bool = False

    @property
    def per_day_sd(self) -> float:
        """Standard deviation of the change of each day."""
        return math.sqrt(float(self.covariance[1, 1]))

    @property
    def chance(self) -> float:
        """Probability of such a change where there is none."""
        return float(2.0 * stdtr(self.freedom, -abs(self.per_day) / self.per_day_sd))

    def at(self, day: Array) -> Array:
        """Return the values of the line at some days."""
        return self.level + self.per_day * np.maximum(day - self.start_day, 0.0)

    def reaches(self, limit: float) -> tuple[float, float, float]:
        """Return when the value reaches a limit: the day, and the earliest and the latest one.

        The two are the ends of Fieller's confidence interval. A day is infinite where the value
        need never get there, and not later than the last day where it is there already.

        Parameters
        ----------
        limit : float
            Of the value without its sign, greater than 0.
        """
        target = math.copysign(limit, self.per_day)
        away = self.level - target
        square = float(stdtrit(self.freedom, 0.5 + 0.5 * CONFIDENCE)) ** 2
        terms = square * self.covariance
        a = self.per_day**2 - terms[1, 1]
        b = 2.0 * (away * self.per_day - terms[0, 1])
        c = away**2 - terms[0, 0]
        day = self.start_day + (-away / self.per_day if self.per_day else math.inf)
        root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
        # Without a significant change the upper end of the band gets there, the lower one never.
        low, high = sorted(((-b - root) / (2.0 * a), (-b + root) / (2.0 * a)))
        earliest, latest = (low, high) if a > 0.0 else (high, math.inf)
        return day, self.start_day + earliest, self.start_day + latest


def drifts(days: Array, values: Array, sds: Array) -> tuple[Line, ...]:
    """Return the line of each of some values that share their scatter.

    Parameters
    ----------
    days : (n,) float64
        Rising, at most one value of each day; n is at least :data:`LEAST_DAYS`.
    values : (n, quantities) float64
        Of the same unit, such as the light of the channels.
    sds : (n,) float64
        Standard deviations within the day. The scatter from day to day is found from the values.

    Returns
    -------
    lines : tuple of Line
        For each quantity the change that chance explains least where there is an alarm, otherwise
        that over all days.
    """
    last = float(days[-1])
    powers = range(2, math.ceil(math.log2(max(last - days[0], 1.0))))
    starts = [float(days[0]), *(last - 2.0**power for power in powers)]
    level = FALSE_ALARMS_A_YEAR / (DAYS_A_YEAR * QUANTITIES * len(starts))
    fitted = [_lines(days, values, sds, start) for start in starts]
    found = []
    for lines in zip(*fitted, strict=True):
        worst = min(lines, key=lambda line: line.chance)
        found.append(replace(worst, alarm=True) if worst.chance < level else lines[0])
    if any(line.alarm for line in found):
        # What is known to drift begins on the day that explains it best. As that day is not known
        # exactly, only the values from then on count for the line.
        every = [_lines(days, values, sds, start) for start in days[: -LEAST_DAYS + 1].tolist()]
        for k, lines in enumerate(zip(*every, strict=True)):
            if found[k].alarm:
                start = min(lines, key=lambda line: line.chance).start_day
                late = days >= start
                found[k] = replace(
                    _lines(days[late], values[late], sds[late], start)[k], alarm=True
                )
    return tuple(found)


def _lines(days: Array, values: Array, sds: Array, start: float) -> tuple[Line, ...]:
    """Return the weighted lines that begin at a day.

    The scatter from day to day is that with which the residuals are as large as expected
    (DerSimonian and Laird 1986, for a line in place of a mean).
    """
    parts = np.stack([np.ones_like(days), np.maximum(days - start, 0.0)])
    freedom = values.shape[1] * (len(days) - 2)
    scatter = 0.0
    variances = np.maximum(sds, LEAST_SD) ** 2
    for _ in range(2):
        weighted = parts / (variances + scatter)
        covariance = np.linalg.inv(weighted @ parts.T)
        solved = covariance @ weighted @ values
        if not scatter:
            square = float((((values - parts.T @ solved) ** 2).T / variances).sum())
            trace = float(np.trace(covariance @ weighted @ weighted.T))
            expected = values.shape[1] * (float((1.0 / variances).sum()) - trace)
            scatter = max(square - freedom, 0.0) / expected
    share = _repeated(values - parts.T @ solved)
    covariance, freedom = covariance * share, max(freedom / share, 1.0)
    first, last = start, float(days[-1])
    return tuple(
        Line(first, last, level, change, covariance, freedom) for level, change in solved.T.tolist()
    )


def _repeated(residuals: Array) -> float:
    """Return how many days of a wandering value are worth one day, 1 or more.

    As for an autoregressive process of first order, whose correlation is estimated too small by
    (1 + 4 r) / n (Marriott and Pope 1954).
    """
    square = float((residuals**2).sum())
    seen = float((residuals[1:] * residuals[:-1]).sum()) / square if square else 0.0
    r = min(max(seen + (1.0 + 4.0 * seen) / len(residuals), 0.0), WANDER)
    return (1.0 + r) / (1.0 - r)
