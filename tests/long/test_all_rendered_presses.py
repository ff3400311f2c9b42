"""All presses of the rendered sensors, calibrated with all of their balls."""

import pytest

from tests.test_accuracy_on_rendered_sensors import (
    BARS,
    calibrated,
    mean_errors,
    test_lights_and_balls_are_where_they_are,
)

__all__ = ["test_lights_and_balls_are_where_they_are"]


@pytest.fixture(scope="module", params=["sensor-A", "sensor-B"])
def sensor(request, shared_data, rendered_optics):
    return calibrated(shared_data / request.param, rendered_optics(request.param, 16), slice(None))


@pytest.mark.parametrize("model", ["paper", "full"])
def test_all_presses_are_within_their_bars(sensor, model):
    assert (mean_errors(sensor, model, slice(None)) < BARS[sensor.folder.name, model]).all()
