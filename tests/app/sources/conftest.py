"""A bench with a small virtual sensor."""

import pytest

from app.sources.virtual_bench import VirtualBench
from gelpolight_core.simulation.sensor_design import SensorDesign


@pytest.fixture
def bench():
    """Return a bench with images of 320 x 240 pixels."""
    return VirtualBench(SensorDesign().scaled(0.25), seed=3)
