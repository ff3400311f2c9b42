"""What is seen of a sensor is kept in its folder, and a drift names the day of its limit."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from gelpolight_core.finding import Verdict
from gelpolight_core.lab.drift import drifts
from gelpolight_core.lab.trend import (
    FILE,
    LED_PERCENT,
    Sample,
    courses,
    drifting,
    followed,
    keep_sample,
    read_samples,
    sample_of_frames,
    sample_of_validation,
)
from gelpolight_core.light.finding import StateChange
from gelpolight_core.quantity import Quantity
from gelpolight_core.validation import Validation

BEGIN = datetime(2026, 1, 1, 9, tzinfo=UTC)
LIMITS = 5.0, 8.0


def change(values: list[float], sd: float = 0.01) -> StateChange:
    return StateChange(np.array(values), np.full(6, sd))


def sensor(days: int, per_day: float, *, calibration: str = "C-1") -> list[Sample]:
    """Return two looks a day at a sensor whose red LED drifts."""
    rng, samples = np.random.default_rng(4), []
    for day in (n + hours / 24.0 for n in range(days) for hours in (0, 7)):
        seen = change([*(np.eye(6)[0] * per_day * day + rng.normal(0.0, 0.05, 6))])
        samples.append(sample_of_frames([seen], calibration, BEGIN + timedelta(days=day)))
    return samples


def test_samples_come_back_as_they_were_and_damage_costs_one_line(tmp_path):
    folder = tmp_path / "sensors" / "S-1"
    made = sensor(3, 0.0)
    for sample in made:
        keep_sample(sample, folder)
    with (folder / FILE).open("a") as file:
        file.write('{"time": "yesterday", "calibration": "C-1", "values": {}}\n{"time"')
    assert list(read_samples(folder)) == made
    assert read_samples(tmp_path) == ()


def test_frames_without_texture_have_no_blur(tmp_path):
    frames = [
        change([1.0, 2.0, 3.0, 0.5, 0.5, math.nan]),
        change([3.0, 2.0, 1.0, 0.5, 0.5, math.nan]),
    ]
    keep_sample(sample_of_frames(frames, "C-1", BEGIN), tmp_path)
    (sample,) = read_samples(tmp_path)
    assert sample.values["light_red"] == pytest.approx((2.0, 0.01))
    assert "blur" not in sample.values and "shift_u" in sample.values


def test_the_drifting_led_is_named_with_the_day_of_its_limit():
    per_day = 0.02
    samples = sensor(30, per_day)
    (finding,) = drifting(samples, "C-1", LIMITS)
    assert finding.key == "light_red_drift" and finding.verdict is Verdict.WARN
    # Against the date by hand: the limit over the drift, from the first day on.
    light, *_ = followed(*LIMITS).values()
    red, green, _ = courses(samples, "C-1", light)
    assert red.line is not None and green.line is not None and not green.line.alarm
    day, earliest, latest = red.line.reaches(LED_PERCENT)
    true = BEGIN.timestamp() / 86400.0 + LED_PERCENT / per_day
    assert earliest < day < latest and day == pytest.approx(true, abs=2.0)
    assert finding.value == pytest.approx(30.44 * per_day, rel=0.1)


def test_each_calibration_begins_anew_and_few_days_are_said_to_be_few():
    samples = [*sensor(30, 0.02), *sensor(2, 0.0, calibration="C-2")]
    assert not drifting(samples, "C-2", LIMITS)
    light, *_ = followed(*LIMITS).values()
    assert [course.line for course in courses(samples, "C-2", light)] == [None] * 3
    assert courses(samples, "C-3", light) == ()


def test_validations_count_with_every_calibration():
    def validation(day: int) -> Validation:
        errors = (
            Quantity("diameter", 5.01, truth=5.0),
            Quantity("height", 1.0 + 0.01 * day, truth=1.0),
        )
        when = (BEGIN + timedelta(days=10 * day)).isoformat()
        return Validation(f"C-{day}", when, "", "cylinder", errors)

    samples = [sample_of_validation(validation(day)) for day in range(6)]
    *_, both = followed(*LIMITS).values()
    size, height = courses(samples, "C-5", both)
    assert size.values == pytest.approx([0.2] * 6)
    assert height.line is not None and height.line.per_day == pytest.approx(0.1)


def test_a_line_through_equal_values_is_constant():
    (line,) = drifts(np.arange(5.0), np.ones((5, 1)), np.full(5, 0.1))
    assert line.level == pytest.approx(1.0) and line.per_day == pytest.approx(0.0)
    assert not line.alarm
