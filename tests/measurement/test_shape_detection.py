"""A user presses an object, and the program says which of the three it is, or that it is none."""

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.measurement.shape_detection import detect_shape
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.simulation.indenters import (
    BallIndenter,
    CuboidIndenter,
    CylinderIndenter,
    press_surface,
)
from gelpolight_core.simulation.pressed_surface import PressedSurface
from tests.measurement.maps import on_grid

PITCH = 0.08
X = np.arange(-9.0, 9.0, PITCH)
Y = np.arange(-8.0, 8.0, PITCH)


def map_of(*surfaces: PressedSurface, noise_mm: float = 0.003) -> HeightMap:
    """Return a noisy height map of what the virtual sensor's membrane does."""
    depth = noise_mm * np.random.default_rng(3).standard_normal((Y.size, X.size))
    for surface in surfaces:
        column = (X - surface.x0_mm) / surface.pitch_mm
        row = (Y - surface.y0_mm) / surface.pitch_mm
        grid = np.meshgrid(column.astype(np.float32), row.astype(np.float32))
        depth += cv2.remap(surface.depth_mm.astype(np.float32), *grid, cv2.INTER_LINEAR)
    return on_grid(depth.astype(np.float32), X, Y)


@pytest.mark.function("Let the program propose the shape")
@pytest.mark.parametrize(
    ("shape", "make"),
    [
        ("ball", lambda: press_surface(BallIndenter(3.0, 0.8), x_mm=1.0, y_mm=-2.0, pitch_mm=0.04)),
        (
            "cylinder",
            lambda: press_surface(CylinderIndenter(4.0, 0.7), x_mm=-2.0, y_mm=1.0, pitch_mm=0.04),
        ),
        (
            "cuboid",
            lambda: press_surface(CuboidIndenter(5.0, 1.0), x_mm=0.5, yaw_deg=25.0, pitch_mm=0.06),
        ),
    ],
)
def test_what_the_virtual_sensor_presses_is_recognised(shape, make):
    found = detect_shape(map_of(make()))
    assert found is not None
    assert found.candidates == (shape,)


def test_what_noise_hides_is_unclear():
    # Shallow and small: cylinder and ball differ by less than the noise.
    found = detect_shape(
        map_of(press_surface(CylinderIndenter(1.2, 0.3), pitch_mm=0.04), noise_mm=0.012)
    )
    assert found is None or len(found.candidates) == 2


@pytest.mark.function("Choose one of several objects by a point")
def test_of_several_the_tallest_or_the_one_pointed_at_is_reported():
    both = map_of(
        press_surface(BallIndenter(3.0, 0.9), x_mm=-4.5, pitch_mm=0.04),
        press_surface(CylinderIndenter(3.0, 0.5), x_mm=4.5, pitch_mm=0.04),
    )
    tallest, pointed = detect_shape(both), detect_shape(both, seed_mm=(4.5, 0.5))
    assert tallest is not None
    assert pointed is not None
    assert (tallest.candidates, pointed.candidates) == (("ball",), ("cylinder",))
    assert tallest.at_mm == pytest.approx((-4.5, 0.0), abs=0.1)
    with pytest.raises(InputError, match="seed"):
        detect_shape(both, seed_mm=(0.0, 7.0))


@pytest.mark.parametrize(
    ("sensor", "name", "expected"),
    [
        ("sensor-A", "cuboid_s5_d125", ("cuboid",)),
        ("sensor-B", "cylinder_s3_d100", ("cylinder",)),
        ("sensor-A", "object_coin", None),
    ],
)
def test_true_surfaces_of_another_renderer_are_recognised(shared_data, sensor, name, expected):
    with np.load(shared_data / sensor / "truth" / f"{name}.npz") as data:
        depth = data["depth_mm"].astype(np.float64)
        pitch, x0, y0 = (float(data[key]) for key in ("pitch_mm", "x0_mm", "y0_mm"))
    stride = max(round(0.08 / pitch), 1)
    depth = depth[::stride, ::stride]
    x, y = (a + stride * pitch * np.arange(n) for a, n in ((x0, depth.shape[1]), (y0, len(depth))))
    found = detect_shape(on_grid(depth.astype(np.float32), x, y))
    assert (None if found is None else found.candidates) == expected
