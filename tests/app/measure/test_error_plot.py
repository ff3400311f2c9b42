"""The plot of errors over time."""

import pytest

from app.measure.error_plot import errors_over_time
from app.services.preferences import Limits
from gelpolight_core.quantity import Quantity
from gelpolight_core.records.entry import MeasurementRecord


def test_what_is_measured_along_the_depth_is_judged_by_the_limit_of_heights():
    quantities = tuple(
        Quantity(f"{name}_mm", 1.02, truth=1.0) for name in ("depth_difference", "distance")
    )
    record = MeasurementRecord("A-1", "", "distance", quantities)
    plane, depth = errors_over_time((record,), Limits())
    assert plane.values == depth.values == pytest.approx((2.0,))
    assert (plane.limit, depth.limit) == (5.0, 8.0)
    assert plane.times_s == (record.time.timestamp(),)
