"""The chart of a sensor's checks: what is in it, and that a wrong clock hides no point."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from app.program.calibration_entries import CalibrationEntry
from app.program.preferences import WarningLimits
from app.sensors.page import checks_over_time
from app.widgets.time_chart import PLANE, ChartSeries, TimeChart
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import Finding, QualityTable
from gelpolight_core.calibration.manifest import CalibrationSummary
from gelpolight_core.session.validation import Validation

BEGIN = datetime(2026, 3, 1, 12, tzinfo=UTC)


def entry(
    day: int, key: str, value: float, validation: Validation | None = None
) -> CalibrationEntry:
    """Return a calibration of a day, with the error of its balls."""
    made = (BEGIN + timedelta(days=day)).isoformat()
    figure = Finding(key, "Error of the balls", value, "%", warn_limit=2.0)
    summary = CalibrationSummary(
        f"C-{day}", "A", "full", made, "", "", "", "", (8, 6),
        {"joint": QualityTable((figure,))}, validation=validation,
    )  # fmt: skip
    return CalibrationEntry(Path(f"{day}.gplcal"), summary)


@pytest.mark.function(
    "See the errors of a sensor's validations and calibrations over time, with the tolerances"
)
def test_calibrations_and_validations_are_in_the_order_of_time_with_their_tolerances():
    lengths = (
        Quantity("diameter", 5.1, truth=5.0, limit_percent=5.0),
        Quantity("width", 3.88, truth=4.0, limit_percent=5.0),
        Quantity("height", 1.04, truth=1.0, limit_percent=8.0),
        Quantity("height", 1.01, truth=1.0, limit_percent=8.0),  # of another press
    )
    when = (BEGIN + timedelta(days=9)).isoformat()
    entries = (
        entry(8, "ball_height_error_percent", 1.5, Validation("C-8", when, "", "cuboid", lengths)),
        entry(0, "held_out_diameter_percent", 1.2),
        entry(3, "reprojection_rms", 0.1),
        CalibrationEntry(Path("broken.gplcal"), None, broken="It is damaged"),
    )
    sizes, heights, balls = checks_over_time(
        entries, WarningLimits(size_percent=4.0, height_percent=6.0)
    )
    assert sizes.values == [pytest.approx(-3.0)], "the larger of two"
    assert heights.values == [pytest.approx(4.0)]
    assert sizes.times_s == heights.times_s == [(BEGIN + timedelta(days=9)).timestamp()]
    assert balls.values == [1.2, 1.5]
    assert (sizes.limit, heights.limit, balls.limit) == (4.0, 6.0, 2.0)


def test_a_clock_that_was_wrong_once_hides_no_other_point(qtbot):
    chart = TimeChart("chart", "Errors")
    qtbot.addWidget(chart)
    chart.resize(400, 200)
    chart.show()
    days = (-20_000, 0, 1, 2, 3, 30_000)
    times = [(BEGIN + timedelta(days=day)).timestamp() for day in days]
    chart.show_series([ChartSeries("size", times, [1.0] * 6, 5.0, PLANE, "o")])
    (left, right), _ = chart._plot.viewRange()
    (points,) = (item for item in chart._plot.listDataItems() if len(item.xData) == 6)
    assert np.diff(points.xData).min() > 0.1 * (right - left)
    assert left <= points.xData[0] and points.xData[-1] <= right
    named = chart._days.tickValues(left, right, 400.0)[0][1]
    days_named = chart._days.tickStrings(named, 1.0, 1.0)
    assert 1 < len(named) < 6 and "2026-03-0" in "".join(days_named)
    chart.show_series([])
    assert chart.shown == ()
