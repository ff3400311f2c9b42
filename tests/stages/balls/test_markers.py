"""Markers printed on the membrane are found by their pattern; dust and texture are not."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.stages.balls.markers import find_markers, inpaint

Image = NDArray[np.float32]
ROWS, COLUMNS = 240, 320


def gel(seed: int = 0, scale: int = 1) -> Image:
    """Return a plain membrane under uneven coloured light, with some noise."""
    rng = np.random.default_rng(seed)
    y, x = np.indices((ROWS * scale, COLUMNS * scale)) / (COLUMNS * scale)
    light = np.stack([0.3 + 0.3 * x, 0.4 + 0.2 * y, 0.6 - 0.3 * x], axis=2)
    return (light + 0.004 * rng.standard_normal(light.shape)).astype(np.float32)


def dotted(image: Image, *, pitch: float, diameter: float, shift: float = 0.0) -> Image:
    """Return a copy with a grid of dark, soft-edged dots."""
    y, x = np.indices(image.shape[:2], dtype=np.float64)
    dx = (x - shift) % pitch - pitch / 2.0
    dy = (y - shift) % pitch - pitch / 2.0
    dark = 1.0 / (1.0 + np.exp((np.hypot(dx, dy) - diameter / 2.0) / 0.5))
    return (image * (1.0 - 0.8 * dark[..., None])).astype(np.float32)


@pytest.mark.parametrize(("pitch", "diameter"), [(20.0, 6.0), (36.0, 12.0), (14.0, 4.5)])
def test_printed_dots_are_found_with_their_size(pitch, diameter):
    image = dotted(gel(), pitch=pitch, diameter=diameter)
    found = find_markers(image)
    assert found
    # The soft edge belongs to the dot.
    assert found.diameter_px == pytest.approx(diameter + 1.5, abs=1.0)
    # All pixels that a dot darkens by a tenth are covered; most of the membrane is not.
    dark = image.mean(axis=2) < 0.9 * gel().mean(axis=2)
    inner = np.s_[20:-20, 20:-20]
    assert (found.mask & dark)[inner].sum() > 0.98 * dark[inner].sum()
    assert found.mask.mean() < 2.5 * dark.mean()


def test_a_plain_gel_has_no_markers():
    assert not find_markers(gel())
    assert not find_markers(gel()).mask.any()


@pytest.mark.parametrize("seed", range(5))
def test_dust_of_many_sizes_and_texture_are_no_markers(seed):
    rng = np.random.default_rng(seed)
    image = gel(seed)
    for _ in range(60):
        at = int(rng.integers(5, COLUMNS - 5)), int(rng.integers(5, ROWS - 5))
        cv2.circle(image, at, int(rng.integers(1, 7)), (0.1, 0.1, 0.1), -1)
    assert not find_markers(image)
    grain = 1.0 + 0.1 * cv2.GaussianBlur(rng.standard_normal((ROWS, COLUMNS)), (0, 0), 1.5)
    assert not find_markers((gel() * grain[..., None]).astype(np.float32))


def test_dots_that_moved_with_the_membrane_are_covered_too():
    background = dotted(gel(), pitch=20.0, diameter=6.0)
    moved = dotted(gel(1), pitch=20.0, diameter=6.0, shift=5.0)
    covered = find_markers(background).covered(moved)
    for image in (background, moved):
        dark = image.mean(axis=2) < 0.7 * gel().mean(axis=2)
        assert (covered & dark)[20:-20, 20:-20].sum() > 0.98 * dark[20:-20, 20:-20].sum()


def test_holes_are_filled_from_around_and_the_rest_is_untouched():
    y, x = np.indices((ROWS, COLUMNS), dtype=np.float32) / COLUMNS
    smooth = np.stack([x, y, 1.0 - x], axis=2).astype(np.float32)
    holes = np.zeros((ROWS, COLUMNS), np.bool_)
    holes[50:58, 60:68] = holes[100:112, 200:212] = True
    spoilt = np.where(holes[..., None], np.float32(9.0), smooth)
    filled = inpaint(spoilt, holes)
    # A hole of 12 px in a slope of 1/320 per pixel: half of its rise.
    np.testing.assert_allclose(filled[holes], smooth[holes], atol=6.0 / COLUMNS)
    np.testing.assert_array_equal(filled[~holes], smooth[~holes])
    assert inpaint(smooth, np.zeros_like(holes)) is smooth
