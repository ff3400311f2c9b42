"""A press of the whole field is named, and not taken for other light or a moved camera."""

from collections.abc import Callable

import known_press
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import shift as moved

from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import BallIndenter, CylinderIndenter
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies.exact_sensor import matt_design

Map = NDArray[np.float32]
Array = NDArray[np.float64]
HALF_MM, PITCH_MM = 15.0, 0.1


@pytest.fixture(scope="module", params=["even", "textured"])
def known(request):
    """Return a sensor with its exact calibration."""
    even = request.param == "even"
    return known_press.known_sensor(matt_design(0.5) if even else SensorDesign().scaled(0.5))


@pytest.fixture(scope="module")
def sensor(known):
    return Reconstructor(known.calibration, effort="fast")


def shape(depth: Callable[[Array, Array], Array]) -> PressedSurface:
    """Return a membrane whose depth is a function of x and y, where it is more than 0."""
    axis = np.arange(-HALF_MM, HALF_MM + PITCH_MM, PITCH_MM)
    deep = np.maximum(depth(*np.meshgrid(axis, axis)), 0.0)
    return PressedSurface(deep, deep > 0.0, -HALF_MM, -HALF_MM, PITCH_MM)


def ball(radius: float, deepest: float) -> Callable[[Array, Array], Array]:
    return lambda x, y: deepest - radius + np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))


WHOLE = {
    "plate 0.4 mm": lambda x, y: np.full_like(x, 0.4),
    "plate 1 mm": lambda x, y: np.full_like(x, 1.0),
    "tilted by 1.2 degrees": lambda x, y: 0.5 + np.tan(np.radians(1.2)) * (0.5 * x - y),
    "ball of 250 mm": ball(250.0, 0.6),
}


@pytest.mark.parametrize("name", WHOLE)
def test_a_press_of_the_whole_field_is_named_as_such(known, sensor, name):
    frame = known.noisy(known.showing(shape(WHOLE[name])).frame)
    for found in (sensor.health(frame), sensor.solver.health_check.check(frame)):
        assert found.keys == ("all_pressed",)
        assert found.light is None
        assert found.faults
        assert found.meaningless is None
    assert sensor.depth(frame, normals=False).doubtful_findings


CHANGES: dict[str, Callable[[Map], Map]] = {
    "exposure": lambda frame: frame * np.float32(1.004),
    "darker": lambda frame: frame * np.float32(0.96),
    "led_weak": lambda frame: frame * np.array([0.98, 1.0, 1.0], np.float32),
    "room_light": lambda frame: frame + np.float32(0.002),
    "camera_moved": lambda frame: moved(frame, (0, 0.9, 0), order=1, mode="nearest"),
}


@pytest.mark.parametrize("press", [BallIndenter(4.0, 0.0), CylinderIndenter(8.0, 0.5)])
def test_a_change_of_the_light_is_not_taken_for_a_press(known, sensor, press):
    frame = known_press.on(known, press, x_mm=2.0).frame
    for name, change in CHANGES.items():
        found = sensor.health(known.noisy(change(frame)))
        assert ("exposure" if name == "darker" else name) in found.keys
        assert "all_pressed" not in found.keys


def test_another_membrane_is_not_taken_for_a_press(sensor):
    other = known_press.known_sensor(SensorDesign().scaled(0.5), seed=1)
    assert "all_pressed" not in sensor.health(other.noisy(other.bare())).keys
