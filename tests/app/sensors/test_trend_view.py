"""The trend of a sensor as the Sensors page draws it."""

from datetime import UTC, datetime, timedelta

import numpy as np

from app.sensors.trend_view import TrendView
from gelpolight_core.lab.trend import DAY_S, LED_PERCENT, Sample, sample_of_frames
from gelpolight_core.light.finding import StateChange

BEGIN = datetime(2026, 3, 1, 12, tzinfo=UTC)


def samples(per_day: float) -> list[Sample]:
    rng = np.random.default_rng(0)
    return [
        sample_of_frames(
            [
                StateChange(
                    np.array([per_day * day, *np.zeros(5)]) + rng.normal(0.0, 0.02, 6),
                    np.full(6, 0.01),
                )
            ],
            "C-1",
            BEGIN + timedelta(days=day),
        )
        for day in range(20)
    ]


def test_the_drift_of_an_led_is_drawn_and_named_with_its_day(qtbot):
    view = TrendView()
    qtbot.addWidget(view)
    view.show_trend(samples(0.015), "C-1", (5.0, 8.0))
    red, green, blue = view.shown
    assert red.line is not None and red.line.alarm
    assert not green.line.alarm and not blue.line.alarm
    day = red.line.reaches(LED_PERCENT)[0]
    true = BEGIN + timedelta(days=LED_PERCENT / 0.015)
    assert abs(day - true.timestamp() / DAY_S) < 2.0
    assert f"{datetime.fromtimestamp(DAY_S * day, UTC).astimezone():%Y-%m-%d}" in view.words.text()
    drawn = view.chart.shown[0]
    assert np.allclose(drawn.times_s, DAY_S * red.days) and np.allclose(drawn.values, red.values)
    assert drawn.limit == LED_PERCENT
    # Other values are chosen, and a sensor without any says so.
    view.group.setCurrentIndex(1)
    assert [course.followed.key for course in view.shown] == ["shift_u", "shift_v"]
    view.group.setCurrentIndex(3)
    assert view.shown == () and view.words.text()
    view.show_trend(samples(0.0), "C-2", (5.0, 8.0))
    assert view.shown == ()
