"""How often chance looks like a drift, how soon a drift is found, and that its line is true."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.lab.drift import CONFIDENCE, LEAST_DAYS, drifts
from gelpolight_core.lab.trend import MONTH_DAYS

SCATTER_PERCENT, WITHIN_DAY_PERCENT = 0.1, 0.02
MONTHLY_PERCENT = 1.0
DAYS = 365


def light(
    rng: np.random.Generator, days: int, *, stable: int, monthly: float
) -> NDArray[np.float64]:
    """Return the light (days, 3) in percent; the red LED drifts after `stable` days."""
    scatter = rng.normal(0.0, SCATTER_PERCENT, (days, 3))
    drift = monthly / MONTH_DAYS * np.maximum(np.arange(days) - stable, 0.0)
    seen: NDArray[np.float64] = scatter + drift[:, None] * (1.0, 0.0, 0.0)
    return seen


def alarms(values: NDArray[np.float64]) -> Iterator[NDArray[np.bool_]]:
    """Yield on each day, from the first test on, which values (days, n) are reported."""
    for count in range(LEAST_DAYS, len(values) + 1):
        lines = drifts(
            np.arange(count, dtype=np.float64), values[:count], np.full(count, WITHIN_DAY_PERCENT)
        )
        yield np.array([line.alarm for line in lines])


def false_alarms(years: int) -> NDArray[np.int64]:
    """Return the number of alarms that begin in each of some years without a drift."""
    counts = []
    for year in range(years):
        rng = np.random.default_rng([1, year])
        shown = np.array(list(alarms(light(rng, DAYS, stable=DAYS, monthly=0.0))))
        begun = shown.any(axis=1).astype(int)
        counts.append(int((np.diff(begun, prepend=0) > 0).sum()))
    return np.array(counts)


def days_to_alarm(trials: int, stable: int) -> NDArray[np.int64]:
    """Return after how many days of drift the red LED is reported, after some stable days."""
    found = []
    for trial in range(trials):
        rng = np.random.default_rng([2, stable, trial])
        values = light(rng, stable + 60, stable=stable, monthly=MONTHLY_PERCENT)
        first = next((day for day, on in enumerate(alarms(values), LEAST_DAYS) if on[0]), 10**6)
        found.append(first - 1 - stable)
    return np.array(found)


def test_one_percent_a_month_of_one_led_is_reported_within_two_weeks() -> None:
    # Daily values with a scatter of 0.1 %, after two weeks without drift.
    days = days_to_alarm(20, stable=14)
    assert days.min() > 0 and days.max() <= 14


def test_constant_light_raises_no_alarm_in_years() -> None:
    # Of 1,000 simulated years, 6 have one.
    assert false_alarms(4).sum() == 0


def test_the_line_and_the_date_hold_the_truth_as_often_as_stated() -> None:
    rng = np.random.default_rng(0)
    days = np.sort(rng.choice(60, 30, replace=False)).astype(np.float64)
    true, limit, held = 0.02, 2.0, 0
    scores = []
    for _ in range(300):
        values = 0.1 + true * (days - days[0])[:, None] + rng.normal(0.0, 0.1, (30, 1))
        (line,) = drifts(days, values, np.full(30, 0.05))
        scores.append((line.per_day - true) / line.per_day_sd)
        when, earliest, latest = line.reaches(limit)
        assert earliest < when < latest
        held += earliest < days[0] + (limit - 0.1) / true < latest
    assert np.std(scores) == pytest.approx(1.0, abs=0.15)
    assert held / 300 == pytest.approx(CONFIDENCE, abs=0.04)


def test_days_of_large_scatter_count_less() -> None:
    days = np.arange(20.0)
    sds = np.where(days % 2, 1.0, 0.001)
    values = np.where(days % 2, 5.0, 0.0)[:, None] * 0.2 + 0.01 * days[:, None]
    (line,) = drifts(days, values, sds)
    assert line.per_day == pytest.approx(0.01, abs=0.03)
    assert line.level < 0.5


def test_without_a_trend_the_limit_has_an_earliest_day_and_no_latest() -> None:
    values = np.random.default_rng(3).normal(0.0, 0.1, (40, 1))
    (line,) = drifts(np.arange(40.0), values, np.zeros(40))
    _, earliest, latest = line.reaches(0.44)
    assert not line.alarm and earliest > 39.0 and latest == np.inf


def test_the_date_holds_the_truth_although_the_begin_of_the_drift_is_not_known() -> None:
    stable, limit, held = 20, 1.5, []
    days = np.arange(40.0)
    for trial in range(60):
        values = light(np.random.default_rng([3, trial]), 40, stable=stable, monthly=1.0)
        line, *_ = drifts(days, values, np.full(40, WITHIN_DAY_PERCENT))
        _, earliest, latest = line.reaches(limit)
        held.append(line.alarm and earliest < stable + limit * MONTH_DAYS < latest)
    assert np.mean(held) > 0.85
