"""The misfit of a closed sensor against a direct computation from its polynomial."""

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.calibration.project import CalibrationRun
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.closed_sensor.polynomial_terms import design_rows, position_axes
from gelpolight_core.session.session_images import read_linear_image

Frame = NDArray[np.uint8]


@pytest.fixture(scope="module")
def reconstructor(closed_run):
    return Reconstructor(closed_run.calibration)


@pytest.fixture(scope="module")
def press(closed_folder):
    rgb = read_linear_image(closed_folder / "balls" / "ball_00.png").rgb
    return np.asarray(np.round(255.0 * rgb), np.uint8)


def slopes_of(run: CalibrationRun, change: np.ndarray) -> np.ndarray:
    """Return the slopes (nodes, 2) of all nodes' colours, term by term in double precision."""
    model = run.calibration.data.in_place
    x, y = (part.ravel() for part in np.meshgrid(*position_axes(*model.grid.shape)))
    return design_rows(change.reshape(-1, 3), x, y).astype(float) @ model.coefficients


def direct(
    run: CalibrationRun, frame: Frame, height_map: HeightMap
) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle in degrees between normals of colours and of the depth, and a misfit.

    The misfit is the least change of colour that makes the slopes agree.
    """
    light = height_map.health.light
    gain = None if light is None else light.share
    seen = run.calibration.data.in_place.change(frame.astype(np.float32) / 255.0, gain)
    colours = slopes_of(run, seen.change)
    down, across = np.gradient(height_map.depth_mm.astype(float), height_map.pitch_mm)
    surface = np.stack([across.ravel(), down.ravel()], axis=1)
    one, other = (np.insert(-slopes, 2, -1.0, axis=1) for slopes in (colours, surface))
    cosine = (one * other).sum(axis=1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
    step = 1e-2
    by_colour = np.stack(
        [
            (slopes_of(run, seen.change + step * axis) - colours) / step
            for axis in np.eye(3, dtype="f4")
        ],
        axis=2,
    )
    least = np.einsum("nks,ns->nk", np.linalg.pinv(by_colour, rcond=1e-2), colours - surface)
    usable = seen.usable.ravel()
    angle_deg = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return angle_deg[usable], np.sqrt((least**2).mean(axis=1))[usable]


@pytest.mark.function("See how well the depth explains the image, also of a closed sensor")
def test_the_misfit_is_that_of_a_direct_computation(closed_run, reconstructor, press):
    """It was 0 for any image once: the depth's gradient was compared with itself."""
    noise = np.random.default_rng(0).integers(0, 256, press.shape).astype(np.uint8)
    angles, misfits = {}, {}
    for name, frame in (("press", press), ("noise", noise), ("inverted", 255 - press)):
        height_map = reconstructor.depth(frame, normals=False)
        angle_deg, expected = direct(closed_run, frame, height_map)
        misfit = reconstructor.misfit(frame, height_map, largest=10_000)
        found = misfit[np.isfinite(misfit)]
        angles[name], misfits[name] = np.mean(angle_deg), np.median(found)
        # Colours that are far from any surface's have no direct computation.
        if name == "press":
            assert found.size == expected.size
            assert np.median(found) == pytest.approx(np.median(expected), rel=0.05)
    assert angles["press"] < 1.0 < 3.0 < min(angles["noise"], angles["inverted"])
    assert 0.0 < 10.0 * misfits["press"] < min(misfits["noise"], misfits["inverted"])


def test_the_image_of_a_surface_has_its_slopes(closed_run, reconstructor, press):
    height_map = reconstructor.depth(press)
    image = reconstructor.predict(height_map)
    known = np.isfinite(image).all(axis=-1)
    found = slopes_of(closed_run, np.nan_to_num(image - 1.0))[known.ravel()]
    down, across = np.gradient(height_map.depth_mm, height_map.pitch_mm)
    expected = np.stack([across[known], down[known]], axis=1)
    assert np.percentile(np.abs(found - expected), 99.0) < 0.02
    assert np.abs(expected).max() > 0.3


def test_a_flat_surface_of_a_closed_sensor_looks_like_the_background(reconstructor, press):
    height_map = reconstructor.depth(press, normals=False)
    height_map.depth_mm[:] = 0.0
    image = reconstructor.predict(height_map, step=3)
    np.testing.assert_allclose(image[np.isfinite(image)], 1.0, atol=1e-6)
