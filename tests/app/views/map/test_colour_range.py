"""The automatic colour range: round, wide enough at once, and steady."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from app.views.map.colour_range import HEADROOM, LEAST_MM, LIMIT, SHRINK_AFTER_S, ColourRange

FRAME_S = 1.0 / 30.0


def _press(depth_mm: float, around_mm: float = 0.0) -> NDArray[np.float32]:
    """Return a flat membrane with a square press in it, and the depth on one side of it."""
    depth = np.zeros((160, 200), np.float32)
    depth[40:80, 60:120] = depth_mm
    depth[100:140, 60:120] = around_mm
    return depth


def _run(
    colours: ColourRange, depth: NDArray[np.float32], seconds: float, start_s: float
) -> tuple[tuple[float, float], float]:
    """Show frames of one depth map. Return the last range and the time of the last frame."""
    shown = (0.0, 0.0)
    for k in range(1, round(seconds / FRAME_S) + 1):
        shown = colours.update(depth, start_s + k * FRAME_S)
    return shown, start_s + round(seconds / FRAME_S) * FRAME_S


@pytest.mark.parametrize(
    ("depth_mm", "high_mm"),
    [
        (0.0, 0.024),
        (0.03, 0.06),
        (0.48, 0.6),
        (0.52, 0.6),
        (0.61, 0.6),
        (0.98, 1.2),
        (1.02, 1.2),
        (2.5, 2.4),
        (2.6, 6.0),
    ],
)
def test_presses_of_about_the_same_round_depth_have_the_same_range(depth_mm, high_mm):
    assert ColourRange().update(_press(depth_mm), 0.0) == (0.0, pytest.approx(high_mm))
    assert high_mm >= LEAST_MM


def test_the_range_stays_while_nothing_is_pressed():
    colours = ColourRange()
    colours.update(_press(0.9), 0.0)
    shown, now_s = _run(colours, _press(0.0), 60.0, 0.0)
    assert shown[1] == pytest.approx(1.2)
    shown, _ = _run(colours, _press(0.8), 1.0, now_s)
    assert shown[1] == pytest.approx(1.2)


def test_a_lighter_press_has_a_smaller_range_after_a_while_and_not_before():
    colours = ColourRange()
    colours.update(_press(0.9), 0.0)
    shown, now_s = _run(colours, _press(0.15), 0.9 * SHRINK_AFTER_S, 0.0)
    assert shown[1] == pytest.approx(1.2)
    shown, _ = _run(colours, _press(0.15), 0.2 * SHRINK_AFTER_S, now_s)
    assert shown[1] == pytest.approx(0.24)


@given(st.lists(st.floats(0.0, 4.0), min_size=2, max_size=40))
def test_all_depths_have_colours_and_the_range_changes_rarely(depths):
    colours = ColourRange()
    shown = [colours.update(_press(d), k * FRAME_S)[1] for k, d in enumerate(depths)]
    assert all(
        d <= high * LIMIT / HEADROOM * (1.0 + 1e-6)
        and float(f"{high / HEADROOM:.0e}") == pytest.approx(high / HEADROOM)
        for d, high in zip(depths, shown, strict=True)
    )
    # These are less than two seconds of frames: too short a time for a smaller range.
    assert all(b >= a for a, b in itertools.pairwise(shown))
