"""Long renderings can be stopped, and the check for a stop changes no image."""

from __future__ import annotations

import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.indenters import Cuboid, press
from gelpolight_core.simulation.virtual_sensor import VirtualSensor

DESIGN = SensorDesign().scaled(0.25)


class Stopped(Exception):
    """The exception that the test uses to stop the work."""


class StopAfter:
    """Allows `count` checks, then stops the work."""

    def __init__(self, count: int) -> None:
        self.count = count

    def __call__(self) -> None:
        """Count down."""
        self.count -= 1
        if self.count < 0:
            raise Stopped


@pytest.fixture(scope="module")
def sensor() -> VirtualSensor:
    return VirtualSensor(DESIGN)


@pytest.mark.parametrize("count", [0, 2])
def test_making_a_sensor_is_stopped(count: int) -> None:
    with pytest.raises(Stopped):
        VirtualSensor(DESIGN, interrupt=StopAfter(count))


@pytest.mark.parametrize("count", [0, 5])
def test_pressing_is_stopped(count: int) -> None:
    with pytest.raises(Stopped):
        press(Cuboid(5.0, 1.0), interrupt=StopAfter(count))
