"""A bench with a small virtual sensor."""

import pytest

from app.sources.bench import Bench
from gelpolight_core.design.sensor_design import SensorDesign


@pytest.fixture
def bench():
    """Return a bench with images of 320 x 240 pixels."""
    return Bench(SensorDesign().scaled(0.25), seed=3)
