"""The full model as its user meets it: presses of the virtual sensor against their truth."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import DepthSolution, SolveRequest
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.virtual_sensor import BareMembrane, VirtualSensor

Map = NDArray[np.float32]


def press(session: Path, name: str = "cylinder_s5_d100") -> Map:
    return read_linear_image(session / "presses" / f"{name}.png").rgb


def solve(rgb: Map, calibration: Calibration, *, workers: int = 2) -> DepthSolution:
    """Solve the whole grid at full scale."""
    return NearLightSolver(calibration.data, workers=workers).depth(
        rgb, SolveRequest(everywhere=True)
    )


def test_an_image_of_the_bare_membrane_is_flat(small_calibration):
    """Another frame than the calibration's, with its own noise."""
    sensor = VirtualSensor(SensorDesign().scaled(0.25), 0)
    frame = sensor.frame(BareMembrane(), averaged=1, stream="another")
    heightmap = Reconstructor(small_calibration).depth(frame)
    inside = np.hypot(heightmap.x_mm[None, :], heightmap.y_mm[:, None]) < 11.0
    # 8-bit noise of 50 dB: slopes of about 0.01 that average out over a node or two of 0.05 mm.
    assert np.sqrt(np.mean(heightmap.depth_mm[inside] ** 2)) < 3e-3
    assert np.abs(heightmap.depth_mm[inside]).max() < 10e-3


def test_normals_belong_to_the_depth(small_session, small_calibration):
    heightmap = Reconstructor(small_calibration).depth(press(small_session))
    assert heightmap.model == "full"
    np.testing.assert_allclose(np.linalg.norm(heightmap.normals, axis=-1), 1.0, atol=1e-5)
    assert (heightmap.normals[..., 2] < 0.0).all()
    slope_y, slope_x = np.gradient(heightmap.depth_mm, heightmap.pitch_mm)
    found = heightmap.normals[..., :2] / heightmap.normals[..., 2:]
    # On the gentle part; at the walls a central difference and a node's normal differ.
    gentle = (np.hypot(slope_x, slope_y) < 0.5) & (heightmap.flags == 0) & (np.abs(slope_x) > 0.05)
    gentle[:, :20] = gentle[:, -20:] = False
    assert gentle.sum() > 500
    assert np.median(np.abs(found[..., 0] - slope_x)[gentle]) < 0.02
    gentle &= np.abs(slope_y) > 0.05
    assert np.median(np.abs(found[..., 1] - slope_y)[gentle]) < 0.02


@pytest.mark.function("Get the same bits for any number of threads")
def test_threads_do_not_change_the_depth(small_session, small_calibration):
    rgb = press(small_session)
    one, two = (solve(rgb, small_calibration, workers=n) for n in (1, 2))
    np.testing.assert_array_equal(one.depth_mm, two.depth_mm)
    np.testing.assert_array_equal(one.flags, two.flags)


def test_a_spoilt_pixel_on_the_ground_leaves_the_plateau_alone(small_session, small_calibration):
    rgb = press(small_session)
    before = solve(rgb, small_calibration)
    top = before.depth_mm > 0.95
    assert top.sum() > 1000
    for value in (np.nan, np.inf, 0.0, 1.0):
        spoilt = rgb.copy()
        spoilt[115:117, 60] = value  # left of the press, on flat ground
        after = solve(spoilt, small_calibration)
        assert np.isfinite(after.depth_mm).all()
        assert np.isfinite(after.normals).all()
        assert np.abs(after.depth_mm - before.depth_mm)[top].max() < 3e-3
        assert 1 <= (after.flags != before.flags).sum() < 100
