"""Scoring a depth map against the truth, on shapes whose errors are known beforehand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.lab.depth_score import DepthScore, TrueDepth, read_true_depth, score_depth

PITCH_MM = 0.05
RADIUS_MM = 6.0


def axis(pitch_mm: float, reach_mm: float = 7.0) -> np.ndarray:
    return pitch_mm * np.arange(-round(reach_mm / pitch_mm), round(reach_mm / pitch_mm) + 1)


def frustum(
    x_mm: np.ndarray, y_mm: np.ndarray, *, height_mm: float = 1.0, radius_mm: float = 2.5, at=(0, 0)
) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Return a round table with walls 0.4 mm wide, half its height at `radius_mm`."""
    x, y = np.meshgrid(x_mm, y_mm)
    away = np.hypot(x - at[0], y - at[1])
    return height_mm * np.clip(0.5 + (radius_mm - away) / 0.4, 0.0, 1.0)


def scored(found: np.ndarray, x_mm: np.ndarray, y_mm: np.ndarray, **options: float) -> DepthScore:
    nodes = axis(PITCH_MM)
    truth = TrueDepth(frustum(nodes, nodes), nodes, nodes)
    given_options = {"height_mm": 1.0, "radius_mm": RADIUS_MM, **options}
    return score_depth(found.astype(np.float32), x_mm, y_mm, truth, **given_options)


def test_the_truth_itself_has_no_error():
    nodes = axis(PITCH_MM)
    score = scored(frustum(nodes, nodes), nodes, nodes)
    assert score.height_percent == pytest.approx(0.0, abs=1e-4)
    assert score.size_percent == pytest.approx(0.0, abs=1e-9)
    assert score.rms_um < 1e-3


@given(st.floats(0.8, 1.2))
def test_a_height_that_is_wrong_by_a_share_is_reported_as_that_share(share):
    nodes = axis(PITCH_MM)
    score = scored(share * frustum(nodes, nodes), nodes, nodes)
    assert score.height_percent == pytest.approx(100 * (share - 1), abs=1e-3)


@given(st.floats(2.0, 3.0))
def test_a_table_of_another_width_has_its_own_size_at_half_height(radius_mm):
    nodes = axis(PITCH_MM)
    score = scored(frustum(nodes, nodes, radius_mm=radius_mm), nodes, nodes)
    # The area is counted in nodes: the rim is uncertain by a small part of one, 2 % of 2.5 mm.
    assert score.size_percent == pytest.approx(100 * (radius_mm / 2.5 - 1), abs=0.5)
    if abs(radius_mm - 2.5) < 0.2:  # the plateau is still on the plateau
        assert score.height_percent == pytest.approx(0.0, abs=1e-4)


def test_a_depth_that_is_off_everywhere_is_off_by_its_rms():
    nodes = axis(PITCH_MM)
    score = scored(frustum(nodes, nodes) + 0.02, nodes, nodes)
    assert score.rms_um == pytest.approx(20.0, abs=1e-3)
    assert score.height_percent == pytest.approx(2.0, abs=1e-3)


def test_rows_are_y_and_columns_are_x():
    nodes = axis(PITCH_MM)
    wide = TrueDepth(frustum(nodes, nodes, at=(1.5, 0.0)), nodes, nodes)
    options = {"height_mm": 1.0, "radius_mm": RADIUS_MM}
    right = frustum(nodes, nodes, at=(1.5, 0.0)).astype(np.float32)
    assert score_depth(right, nodes, nodes, wide, **options).rms_um < 1e-3
    assert score_depth(np.ascontiguousarray(right.T), nodes, nodes, wide, **options).rms_um > 100.0


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04cut", None])
def test_a_truth_that_cannot_be_read_is_refused(tmp_path, content):
    path = tmp_path / "press.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError):
        read_true_depth(path)


@pytest.mark.parametrize("changed", [{"x0_mm": np.nan}, {"depth_mm": np.full((4, 5), 900.0)}])
def test_a_truth_of_another_unit_or_without_a_place_is_refused(changed, tmp_path):
    good = {"depth_mm": np.ones((4, 5)), "x0_mm": 0.0, "y0_mm": 0.0, "pitch_mm": 0.5}
    np.savez(tmp_path / "truth.npz", **good)
    assert read_true_depth(tmp_path / "truth.npz").depth_mm.shape == (4, 5)
    np.savez(tmp_path / "truth.npz", **(good | changed))
    with pytest.raises(InputError):
        read_true_depth(tmp_path / "truth.npz")
