"""Long renderings can be stopped, and the check for a stop changes no image."""

from __future__ import annotations

import numpy as np
import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.indenters import Cuboid, press
from gelpolight_core.simulation.rays import (
    trace_pixels,
    trace_points,
)
from gelpolight_core.simulation.session import checkerboard_poses, pressed_membrane
from gelpolight_core.simulation.virtual_sensor import BoardOnTop, Checkerboard, VirtualSensor

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


def test_images_of_a_press_and_of_a_board_can_be_stopped(sensor: VirtualSensor) -> None:
    state = pressed_membrane(DESIGN, Cuboid(4.0, 1.0), x_mm=0.0, y_mm=0.0)
    for shown in (state, BoardOnTop()):
        with pytest.raises(Stopped):
            sensor.brightness(shown, interrupt=StopAfter(1))


def test_pixels_are_traced_alike_in_bands_and_at_once() -> None:
    camera = DESIGN.camera
    v, u = np.mgrid[: camera.height_px, : camera.width_px].astype(float)
    at_once = trace_points(camera, DESIGN.layers, u, v)
    in_bands = trace_pixels(camera, DESIGN.layers)
    # 1e-12 mm: the last bit of the numbers.
    assert np.allclose(in_bands.x_mm, at_once.x_mm, rtol=0.0, atol=1e-12)
    assert np.allclose(in_bands.transmission, at_once.transmission, rtol=0.0, atol=1e-12)


def test_the_poses_of_a_session_are_had_one_by_one(sensor: VirtualSensor) -> None:
    poses = checkerboard_poses(DESIGN)
    assert len(poses) == 16
    # Each fills a large part of the image: white paper brighter than the room behind it.
    image = sensor.brightness(Checkerboard(poses[3]))[..., 0]
    assert 0.1 < (image > 0.5).mean() < 0.6
