"""The focus and exposure checks and the stripes agree with a technician's judgement."""

import cv2
import numpy as np
import pytest

from app.live.image_checks import (
    STRIPE_RGB,
    BestFocus,
    channel_histograms,
    eight_bits,
    measure_exposure,
    measure_focus,
    saturation_image,
    with_zebra,
)
from gelpolight_core.base.finding import Verdict

DEPTHS = [np.uint8, np.uint16]


def image(level: float, dtype: type = np.uint8) -> np.ndarray:
    """Return a uniform image (120, 160, 3) at a share of the scale."""
    return np.full((120, 160, 3), round(level * np.iinfo(dtype).max), dtype)


def scene(dtype: type = np.uint8) -> np.ndarray:
    """Return an image with detail, half as bright as the scale."""
    rng = np.random.default_rng(4)
    coarse = rng.uniform(0.1, 0.5, (30, 40, 3)).astype(np.float32)
    fine = cv2.resize(coarse, (160, 120), interpolation=cv2.INTER_NEAREST)
    return (fine * np.iinfo(dtype).max).astype(dtype)


@pytest.mark.function("See exposure, focus and saturation of the live image")
@pytest.mark.parametrize("dtype", DEPTHS)
def test_three_percent_of_saturation_are_reported_with_advice(dtype):
    rgb = image(0.5, dtype)
    count = round(0.03 * 120 * 160)
    rgb.reshape(-1, 3)[:count, 1] = np.iinfo(dtype).max
    exposure = measure_exposure(rgb)
    assert exposure.value == pytest.approx(3.0, abs=0.01)
    assert exposure.verdict is Verdict.FAIL
    assert exposure.text == ("Too bright: 3 % of the pixels are saturated. Shorten the exposure.")


@pytest.mark.parametrize("dtype", DEPTHS)
def test_a_dark_image_needs_a_longer_exposure(dtype):
    few_hot = image(0.05, dtype)
    few_hot[::40, ::60] = 0.7 * np.iinfo(dtype).max
    for rgb, verdict in ((image(0.1, dtype), Verdict.WARN), (few_hot, Verdict.FAIL)):
        exposure = measure_exposure(rgb)
        assert exposure.verdict is verdict
        assert "Lengthen the exposure" in exposure.text
        assert measure_exposure(rgb, dark=False).verdict is Verdict.PASS, "dark by design"
    spots = image(0.0, dtype)  # as of the mirror
    for k, (row, column) in enumerate(((20, 30), (60, 80), (100, 140))):
        spots[row : row + 4, column : column + 4, k] = 0.8 * np.iinfo(dtype).max
    for rgb in (spots, image(0.3, dtype), image(0.95, dtype)):
        assert measure_exposure(rgb).verdict is Verdict.PASS


@pytest.mark.parametrize("dtype", DEPTHS)
def test_focus_falls_with_every_bit_of_blur(dtype):
    sharp = scene(dtype)
    blurred = [cv2.GaussianBlur(sharp, (0, 0), sigma) for sigma in (0.7, 1.0, 1.5, 2.5)]
    figures = [measure_focus(rgb) for rgb in (sharp, *blurred)]
    assert figures == sorted(figures, reverse=True)
    assert figures[0] > 2.0 * figures[-1]


def test_the_best_focus_is_remembered_while_the_lens_turns_further():
    best = BestFocus()
    shares = [best.update(figure, 0.1 * i) for i, figure in enumerate((1.0, 2.0, 4.0, 2.0))]
    assert shares[:3] == [1.0, 1.0, 1.0]
    assert shares[3] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("dtype", DEPTHS)
def test_the_histogram_counts_every_pixel_once_and_the_end_of_scale_last(dtype):
    rgb = image(0.25, dtype)
    rgb[:10, :, 2] = np.iinfo(dtype).max
    counts = channel_histograms(rgb)
    assert counts.shape == (3, 64)
    assert (counts.sum(axis=1) == 120 * 160).all()
    assert counts[2, -1] == 10 * 160
    assert counts[0, -1] == 0


@pytest.mark.parametrize("dtype", DEPTHS)
def test_stripes_lie_on_saturated_pixels_only(dtype):
    rgb = image(0.5, dtype)
    rgb[30:60, 40:90, 0] = np.iinfo(dtype).max
    before = rgb.copy()
    shown = with_zebra(rgb)
    striped = (shown == STRIPE_RGB).all(axis=2)
    full = saturation_image(rgb) > 0
    assert not (striped & ~full).any()
    assert 0.4 < striped[full].mean() < 0.6
    assert (shown[~full] == eight_bits(rgb)[~full]).all()
    np.testing.assert_array_equal(rgb, before)
