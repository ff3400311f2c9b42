"""How often chance looks like a drift, how soon a drift is found, and that its line is true."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.lab.drift import CONFIDENCE, LEAST_DAYS, drifts
from gelpolight_core.lab.trend import MONTH_DAYS

WITHIN_DAY_PERCENT = 0.02


def light(seed: list[int], days: int, stable: int) -> NDArray[np.float64]:
    """Return the light (days, 3) in percent; red drifts by 1 % a month after `stable` days."""
    scatter = np.random.default_rng(seed).normal(0.0, 0.1, (days, 3))
    drift = np.maximum(np.arange(days) - stable, 0.0) / MONTH_DAYS
    return np.asarray(scatter + drift[:, None] * (1.0, 0.0, 0.0))


def reported(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return on which days, from the first possible one on, which LEDs are reported (days, 3)."""
    days, sds = np.arange(float(len(values))), np.full(len(values), WITHIN_DAY_PERCENT)
    lines = [drifts(days[:n], values[:n], sds[:n]) for n in range(LEAST_DAYS, len(values) + 1)]
    return np.array([[line.alarm for line in found] for found in lines])


def test_one_percent_a_month_of_one_led_is_reported_within_two_weeks():
    # Daily values with a scatter of 0.1 %, after two weeks without drift.
    for trial in range(20):
        red = reported(light([2, 14, trial], 29, 14))[:, 0]
        assert red.any() and LEAST_DAYS + np.argmax(red) > 15


def test_constant_light_raises_no_alarm_in_years():
    # Of 1,000 simulated years, 6 have one.
    assert not any(reported(light([1, year], 365, 365)).any() for year in range(4))


def test_the_line_and_the_date_hold_the_truth_as_often_as_stated():
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


def test_days_of_large_scatter_count_less():
    days = np.arange(20.0)
    sds = np.where(days % 2, 1.0, 0.001)
    values = np.where(days % 2, 5.0, 0.0)[:, None] * 0.2 + 0.01 * days[:, None]
    (line,) = drifts(days, values, sds)
    assert line.per_day == pytest.approx(0.01, abs=0.03)
    assert line.level < 0.5


def test_without_a_trend_the_limit_has_an_earliest_day_and_no_latest():
    values = np.random.default_rng(3).normal(0.0, 0.1, (40, 1))
    (line,) = drifts(np.arange(40.0), values, np.zeros(40))
    _, earliest, latest = line.reaches(0.44)
    assert not line.alarm and earliest > 39.0 and latest == np.inf


def test_the_date_holds_the_truth_although_the_begin_of_the_drift_is_not_known():
    stable, limit, held = 20, 1.5, []
    days = np.arange(40.0)
    for trial in range(60):
        values = light([3, trial], 40, stable)
        line, *_ = drifts(days, values, np.full(40, WITHIN_DAY_PERCENT))
        _, earliest, latest = line.reaches(limit)
        held.append(line.alarm and earliest < stable + limit * MONTH_DAYS < latest)
    assert np.mean(held) > 0.85
