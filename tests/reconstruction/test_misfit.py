"""The image that a surface should give, and how far from it an image is."""

from dataclasses import replace

import cv2
import known_press
import numpy as np
import pytest

from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.simulation.indenters import CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign

MODELS = ("paper", "full")


@pytest.fixture(scope="module")
def press(small_session):
    return read_linear_image(small_session / "balls" / "ball_00.png").rgb


@pytest.fixture(scope="module")
def known():
    """Return a glossy sensor with crosstalk."""
    return known_press.known_sensor(SensorDesign().scaled(0.25))


@pytest.fixture(scope="module")
def surface(known):
    """Return a function that gives the true surface of a cylinder pressed so deep."""
    calibration = known.calibration
    grid = calibration.table.grid

    def made(height_mm: float) -> HeightMap:
        truth = known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=2.0).truth
        pitch = truth.x_mm[1] - truth.x_mm[0]
        x, y = np.meshgrid((grid.x_mm - truth.x_mm[0]) / pitch, (grid.y_mm - truth.y_mm[0]) / pitch)
        depth = cv2.remap(
            (height_mm * truth.depth_mm).astype(np.float32),
            x.astype(np.float32),
            y.astype(np.float32),
            cv2.INTER_LINEAR,
        )
        flags = np.zeros(depth.shape, np.uint8)
        name = calibration.identity
        return HeightMap(
            depth, grid.x_mm, grid.y_mm, grid.pitch_mm, None, flags, name, "full", "true"
        )

    return made


@pytest.mark.parametrize("model", MODELS)
def test_a_flat_surface_looks_like_the_background(model, known, surface):
    image = Reconstructor(known.calibration, model=model).predict(surface(0.0))
    assert np.isfinite(image).any()
    assert np.nanmax(np.abs(image - 1.0)) < 1e-3


def test_the_image_of_a_true_surface_is_that_of_the_camera(known, surface):
    """Crosstalk is a part of it: without, the image would be off by 9 %."""
    frame = known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=2.0).frame
    true = surface(1.0)
    pressed = true.depth_mm > 0.05
    left = np.abs(Reconstructor(known.calibration).residual(frame, true)).mean(axis=-1)
    assert np.nanmedian(left[pressed]) < 1e-3
    assert np.nanmean(left[pressed]) < 0.015  # edges that the pixels blur
    unmixed = Reconstructor(known.calibration.changed(crosstalk=np.eye(3)))
    wrong = np.abs(unmixed.residual(frame, true)).mean(axis=-1)
    assert np.nanmedian(wrong[pressed]) > 0.05
    too_flat = np.abs(Reconstructor(known.calibration).residual(frame, surface(0.8))).mean(axis=-1)
    assert np.nanmean(too_flat[pressed]) > 2.0 * np.nanmean(left[pressed])


@pytest.mark.parametrize(("model", "most"), [("paper", 0.03), ("full", 0.02)])
def test_a_true_surface_explains_its_image_and_a_false_one_does_not(
    model, most, small_calibration, press
):
    reconstruct = Reconstructor(small_calibration, model=model, effort="best")
    heightmap = reconstruct.depth(press, normals=False)
    true = reconstruct.misfit(press, heightmap, largest=10_000)
    assert true.shape == heightmap.depth_mm.shape
    assert np.nanmedian(true) < most
    assert np.isnan(true[heightmap.flags & 1 != 0]).all()
    lying = replace(heightmap, depth_mm=np.zeros_like(heightmap.depth_mm))
    false = reconstruct.misfit(press, lying, largest=10_000)
    pressed = heightmap.depth_mm > 0.3 * heightmap.depth_mm.max()
    assert np.nanmean(false[pressed]) > 3.0 * np.nanmean(true[pressed])
