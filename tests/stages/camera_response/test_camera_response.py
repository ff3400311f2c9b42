"""The camera response: measured from exposures, refused if it cannot be, and undone in images."""

from collections.abc import Callable

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.image.response import (
    NODES,
    CameraResponse,
    declared_response,
    gamma_response,
    srgb_response,
)
from gelpolight_core.stages.camera_response.response_stage import declare_response, measure_response

Encode = Callable[[np.ndarray], np.ndarray]
TIMES = (0.5, 2.0, 6.0, 12.0, 18.0, 27.0)
EVEN = np.linspace(0.0, 1.0, NODES)


def srgb(light: np.ndarray) -> np.ndarray:
    """Encode by the formula of the standard."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def shoulder(light: np.ndarray) -> np.ndarray:
    """Encode with compressed highlights, as many cameras do; no power law fits it."""
    return 1.4 * light / (light + 0.4)


def series(
    encode: Encode,
    *,
    times: tuple[float, ...] = TIMES,
    bits: int = 8,
    fall_off: float = 4.0,
    seed: int = 1,
    flicker: float = 0.0,
    shift: int = 0,
) -> list[LinearImage]:
    """Return images of a whiteboard with a brightness gradient and the noise of a 50 dB camera."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:240, :320]
    board = 0.058 * fall_off ** -(((u - 160) ** 2 + (v - 120) ** 2) / 200.0**2)
    board = np.stack([board, 0.9 * board, 0.8 * board], axis=-1)
    board[100:140, 30:60] *= 0.4
    images = []
    for number, time in enumerate(times):
        light = np.roll(board, shift * number, axis=1) * time
        light = light * (1.0 + flicker * (-1) ** number)
        light = light + rng.standard_normal(light.shape) * np.sqrt(4e-5 * light + 0.0015**2)
        full = 2**bits - 1
        value = np.rint(full * encode(np.clip(light, 0.0, 1.0))) / full
        images.append(LinearImage(f"exp_{number}.png", value.astype(np.float32), bit_depth=bits))
    return images


ENCODINGS: dict[str, tuple[Encode, np.ndarray]] = {
    "gamma 0.7": (lambda x: x ** (1 / 0.7), EVEN**0.7),
    "shoulder": (shoulder, 0.4 * EVEN / (1.4 - EVEN)),
}


@pytest.mark.parametrize(("name", "bits"), [("gamma 0.7", 16), ("shoulder", 8)])
def test_the_curve_of_a_noisy_series_is_the_camera_s_within_a_third_of_a_percent(name, bits):
    """A step of 8 bit is 0.4 % of full scale; such a curve error causes 0.5 % of depth error."""
    encode, truth = ENCODINGS[name]
    result = measure_response(series(encode, bits=bits), TIMES)
    assert np.abs(result.response.curves - truth).max() < 0.0033
    assert result.quality.verdict is Verdict.PASS, result.quality.remedies


def test_a_curve_is_found_to_half_a_percent_where_exposures_are_not_quite_what_is_stated():
    """Shutters repeat to a few tenths of a percent."""
    result = measure_response(series(srgb, flicker=0.002), TIMES)
    assert np.abs(result.response.curves - srgb_response().curves).max() < 0.005


def test_a_linear_camera_is_called_linear_and_not_corrected():
    result = measure_response(series(lambda x: x), TIMES)
    assert result.response is None
    assert "not applied" in result.summary
    assert result.quality["response_departure_percent"].value < 0.25


def test_a_gamma_that_would_cost_four_percent_of_depth_is_not_called_linear():
    result = measure_response(series(lambda x: x ** (1 / 0.95)), TIMES)
    assert np.abs(result.response.curves - EVEN**0.95).max() < 0.0033


def test_what_is_declared_is_held_against_what_is_measured():
    images = series(lambda x: x ** (1 / 2.2))
    right = measure_response(images, TIMES, declared=2.2)
    assert right.quality["response_declared_difference_percent"].verdict is Verdict.PASS
    wrong = measure_response(images, TIMES, declared=1.8)
    assert wrong.quality["response_declared_difference_percent"].verdict is Verdict.WARN
    np.testing.assert_array_equal(wrong.response.curves, right.response.curves)


def refused(images: list[LinearImage], times: tuple[float, ...]) -> str:
    """Return the message with which a series is refused."""
    with pytest.raises(InputError) as refusal:
        measure_response(images, times)
    return str(refusal.value)


def test_series_that_cannot_tell_are_refused():
    def bent(light: np.ndarray) -> np.ndarray:
        return light ** (1 / 2.2)

    for times in ((1.0, 8.0), (8.0, 8.0, 1.0)):
        assert "2 different exposures" in refused(series(bent, times=times), times)
    for times in ((3.0, 4.0, 5.0), (2.0, 3.0, 7.9)):
        assert "over a factor of" in refused(series(bent, times=times), times)
    bright = (400.0, 800.0, 1600.0, 3200.0)
    assert "not dark, saturated" in refused(series(bent, times=bright), bright)
    dark = (1e-4, 1e-3, 1e-2, 1e-1)
    assert "not dark, saturated" in refused(series(bent, times=dark), dark)


def test_a_scene_that_moved_is_refused():
    assert "disagree" in refused(series(lambda x: x ** (1 / 2.2), shift=12), TIMES)


def test_light_that_flickered_is_refused():
    assert "disagree" in refused(series(lambda x: x, flicker=0.06), TIMES)


def test_declared_curves_are_the_standards():
    gamma, encoded = gamma_response(2.2), np.arange(256) / 255.0
    np.testing.assert_allclose(np.interp(encoded, EVEN, gamma.curves[0]), encoded**2.2, atol=1e-12)
    light = np.linspace(0.0, 1.0, 1000)
    for curve in srgb_response().curves:
        np.testing.assert_allclose(np.interp(srgb(light), EVEN, curve), light, atol=1e-6)
    assert gamma_response(1.0) is None
    assert declared_response("linear") is None
    assert declare_response(None).summary != declare_response("linear").summary


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_frames_become_linear_light_channel_by_channel(kind):
    bend = np.stack([EVEN**1.5, EVEN**2.0, EVEN**2.5])
    full = np.iinfo(kind).max
    frame = np.random.default_rng(2).integers(0, full, (40, 30, 3), kind, endpoint=True)
    frame[0, 0], frame[0, 1] = 0, full
    light = CameraResponse(bend).linearise(frame)
    assert light.dtype == np.float32
    np.testing.assert_allclose(light, (frame / full) ** [1.5, 2.0, 2.5], atol=2e-6)
    # Saturation is detected by full scale, which does not change.
    assert (light[0, 0] == 0.0).all()
    assert (light[0, 1] == 1.0).all()
