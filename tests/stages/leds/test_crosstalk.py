"""Crosstalk from single-LED images: the mixing matrix of the camera, or a reasoned refusal."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.stages.leds.crosstalk import find_crosstalk
from gelpolight_core.stages.leds.mirror_spots import MirrorSpot, MirrorSpots

TRUTH = np.array([[1.0, 0.04, 0.02], [0.05, 1.0, 0.05], [0.02, 0.04, 1.0]])
NAMES = ("red.png", "green.png", "blue.png")


def spots(matrix: np.ndarray) -> MirrorSpots:
    """Return mirror spots whose colours are the columns of a matrix."""
    made = tuple(
        MirrorSpot((0.0, 0.0), 0.05, 9, (0.5, 0.5, 0.5), (1.0, 1.0, 1.0), tuple(column), 1.0, False)
        for column in matrix.T
    )
    return MirrorSpots((made[0], made[1], made[2]), (), QualityTable())


def single_led(
    matrix: np.ndarray, *, offset: float = 0.0, peak: float = 0.8, even: bool = False, seed: int = 1
) -> list[LinearImage]:
    """Return the whiteboard under each LED in turn, 8 bit, with dust and 50 dB noise."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:240, :320]
    images = []
    for led, name in enumerate(NAMES):
        board = np.exp(-(((u - 90 - 70 * led) / 200.0) ** 2) - ((v - 120) / 200.0) ** 2)
        board = peak * (np.ones_like(board) if even else board)
        light = board[..., None] * matrix[:, led] + offset
        light[60:80, 200:230] = 0.7 * light[60:80, 200:230] + 0.1
        light = light + rng.standard_normal(light.shape) * np.sqrt(4e-5 * light + 0.0015**2)
        shown = np.rint(255.0 * np.clip(light, 0.0, 1.0)) / 255.0
        images.append(LinearImage(name, shown.astype(np.float32)))
    return images


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.floats(0.0, 0.3), min_size=6, max_size=6),
    st.floats(0.0, 0.03),
    st.floats(0.3, 1.3),
    st.integers(0, 2**16),
)
def test_the_mixture_is_found_whatever_the_dark_level_and_exposure(leaks, offset, peak, seed):
    """Within half a percent: two grey levels of the brightest pixels."""
    matrix = np.eye(3)
    matrix[~np.eye(3, dtype=bool)] = leaks
    found = find_crosstalk(
        spots(np.eye(3)), single_led(matrix, offset=offset, peak=peak, seed=seed)
    )
    assert found.source == "single_led"
    assert np.abs(found.matrix - matrix).max() < 0.005


def test_a_camera_without_crosstalk_has_none():
    found = find_crosstalk(spots(np.eye(3)), single_led(np.eye(3)))
    assert np.abs(found.matrix - np.eye(3)).max() < 0.002


def test_crosstalk_that_no_spot_shows_is_a_warning_and_not_zero():
    hidden = TRUTH.copy()
    hidden[:, 1:] = np.nan
    figures = find_crosstalk(spots(hidden)).quality
    assert figures["crosstalk_unmeasured"].value == 2.0
    assert figures.verdict is Verdict.WARN
    assert "single_led" in figures.remedies[0]
    assert figures["crosstalk_percent"].value == pytest.approx(5.0)
    hidden[:, 0] = np.nan
    none = find_crosstalk(spots(hidden)).quality
    assert [(f.key, f.value) for f in none.figures] == [("crosstalk_unmeasured", 3.0)]
    mended = find_crosstalk(spots(hidden), single_led(TRUTH))
    assert mended.quality.verdict is Verdict.PASS
    assert np.abs(mended.matrix - TRUTH).max() < 0.005
    both = find_crosstalk(spots(TRUTH), single_led(TRUTH)).quality
    assert both["crosstalk_difference_percent"].value < 1.0


def swap(images: list[LinearImage]) -> list[LinearImage]:
    return [images[1], images[0], images[2]]


def all_lit(images: list[LinearImage]) -> list[LinearImage]:
    light = np.minimum(sum(p.rgb for p in images), 1.0).astype(np.float32)
    return [LinearImage(p.name, light) for p in images]


def times(factor: float) -> Callable[[list[LinearImage]], list[LinearImage]]:
    return lambda images: [
        LinearImage(p.name, np.minimum(factor * p.rgb, 1.0).astype(np.float32)) for p in images
    ]


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (swap, "single_led/green.png: The green channel has .* of the red channel"),
        (all_lit, "of the red channel's light.*Capture one image of each LED alone"),
        (times(0.05), "is dark"),
        (times(60.0), "saturated"),
    ],
)
def test_images_of_something_else_are_refused(change, what):
    with pytest.raises(InputError, match=what):
        find_crosstalk(spots(TRUTH), change(single_led(TRUTH)))
