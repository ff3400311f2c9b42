"""The fused pass against the plain version, and against slopes that are known."""

import numpy as np
import pytest
import scene
from reference.plain_paper import plain_depth, plain_slopes

from gelpolight_core.base.errors import InputError
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.paper.paper_solver import PaperSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor

CALIBRATION = scene.calibration()
SOLVER = PaperSolver(CALIBRATION.data, workers=1)
TABLE = CALIBRATION.table


def lopsided(points: np.ndarray) -> np.ndarray:
    """Return slopes of 0.6 exp(-((x-2)^2/4 + (y+1)^2)), which no swap or flip leaves alone."""
    x, y = points[..., 0] - 2.0, points[..., 1] + 1.0
    bump = 0.6 * np.exp(-(x**2) / 4 - y**2)
    return np.stack([-x / 2 * bump, -2 * y * bump], axis=-1)


@pytest.mark.function("Reconstruct by the paper's model")
def test_known_slopes_are_found_with_their_signs():
    field = SOLVER.slopes(scene.raw_image(lopsided, CALIBRATION))
    expected = lopsided(CALIBRATION.table.grid.points_mm())
    seen = field.flags & int(Flag.OUTSIDE) == 0
    # A pixel is 0.1 mm here and the image is interpolated between pixels.
    np.testing.assert_allclose(field.slope_x[seen], expected[seen][:, 0], atol=0.02)
    np.testing.assert_allclose(field.slope_y[seen], expected[seen][:, 1], atol=0.02)


def test_the_fused_pass_is_the_plain_mathematics():
    raw = scene.raw_image(lopsided, CALIBRATION)
    raw8 = np.round(np.clip(raw, 0, 1) * 255).astype(np.uint8)
    field = SOLVER.slopes(raw8)
    slope_x, slope_y = plain_slopes(raw8, CALIBRATION)
    seen = field.flags & int(Flag.OUTSIDE) == 0
    np.testing.assert_allclose(field.slope_x[seen], slope_x[seen], atol=2e-4)
    np.testing.assert_allclose(field.slope_y[seen], slope_y[seen], atol=2e-4)
    depth = Reconstructor(CALIBRATION).depth(raw8).depth_mm
    plain = plain_depth(slope_x, slope_y, CALIBRATION.table.grid.pitch_mm)
    assert np.abs(depth - plain)[seen].max() < 2e-3


def test_bad_pixels_are_flagged_and_the_rest_is_unchanged():
    raw = scene.raw_image(lopsided, CALIBRATION)
    bad = raw.copy()
    bad[100, 120] = np.nan
    bad[101, 140] = np.inf
    bad[130, 160] = 1.0
    bad[80, 150, 2] = 0.0
    bad[60, 170] = -1.0
    clean, field = SOLVER.slopes(raw), SOLVER.slopes(bad)
    touched = field.flags != clean.flags
    assert np.isfinite(field.slope_x).all()
    assert (field.flags & int(Flag.SATURATED)).any()
    assert (field.flags & int(Flag.INVALID)).any()
    assert (field.flags & int(Flag.DARK)).any()
    near = np.zeros_like(touched)
    for v, u in ((100, 120), (101, 140), (130, 160), (80, 150), (60, 170)):
        near |= (np.abs(TABLE.v_px - v) < 1.001) & (np.abs(TABLE.u_px - u) < 1.001)
    np.testing.assert_array_equal(field.slope_x[~near], clean.slope_x[~near])
    assert np.isfinite(Reconstructor(CALIBRATION).depth(bad).depth_mm).all()


def test_an_image_of_another_size_is_refused_with_both_sizes():
    with pytest.raises(InputError, match="320x240x3") as refusal:
        Reconstructor(CALIBRATION).depth(np.zeros((480, 640, 3), np.uint8), name="other.png")
    assert "640x480x3" in str(refusal.value)
    assert refusal.value.where == "other.png"
