"""All presses of the rendered sensors, calibrated with all of their balls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gelpolight_core.calibration.recipe import Results
from tests.test_accuracy_on_rendered_sensors import (
    BARS,
    Sensor,
    calibrated,
    mean_errors,
    test_lights_and_balls_are_where_they_are,
)

__all__ = ["test_lights_and_balls_are_where_they_are"]


@pytest.fixture(scope="module", params=["sensor-A", "sensor-B"])
def sensor(
    request: pytest.FixtureRequest, shared_data: Path, rendered_optics: Callable[[str], Results]
) -> Sensor:
    return calibrated(shared_data / request.param, rendered_optics(request.param), slice(None))


@pytest.mark.parametrize("model", ["paper", "full"])
def test_all_presses_are_within_their_bars(sensor: Sensor, model: str) -> None:
    assert (mean_errors(sensor, model, slice(None)) < BARS[sensor.folder.name, model]).all()
