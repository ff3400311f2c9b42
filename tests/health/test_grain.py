"""An image that was processed has another grain; a mean of frames has not."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import known_press
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.health.health_samples import choose_samples
from gelpolight_core.image.grain import Grain, grain_of
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import BallIndenter, CylinderIndenter
from gelpolight_core.studies.exact_sensor import ExactSensor, matt_design

Image = NDArray[Any]
Map = NDArray[np.float32]
PLACES = ((-4.0, 3.0), (4.0, 3.0), (0.0, -4.0), (4.0, -3.0))


@pytest.fixture(scope="module")
def known():
    """Return a sensor with an even membrane, which shows no blur by its texture."""
    return known_press.known_sensor(matt_design(0.5))


@pytest.fixture(scope="module")
def balls(known):
    """Return images of ball presses, as captured for a calibration."""
    return [
        known.noisy(
            known_press.on(known, BallIndenter(3.0, 0.8), x_mm=x, y_mm=y).frame, seed=50 + n
        )
        for n, (x, y) in enumerate(PLACES)
    ]


@pytest.fixture(scope="module")
def press(known):
    """Return the image of a cylinder, linear light without noise."""
    return known_press.on(known, CylinderIndenter(5.0, 1.0), x_mm=1.0).frame


def measured(known: ExactSensor, images: list[Image]) -> Grain:
    """Return the grain of 8-bit images."""
    light = [np.asarray(image / np.float32(255.0), np.float32) for image in images]
    found = grain_of(light, choose_samples(known.calibration.data).blocks)
    assert found is not None
    return found


def check_with(known: ExactSensor, images: list[Image]) -> HealthCheck:
    """Return the check of a sensor whose calibration was made with these images."""
    return HealthCheck(replace(known.calibration.data, grain=measured(known, images)))


@pytest.fixture(scope="module")
def check(known, balls):
    """Return the check of the sensor, calibrated with uncompressed images."""
    return check_with(known, balls)


def jpeg(image: Image, quality: int) -> Image:
    """Return an image as a JPEG file of some quality holds it."""
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1])


def resized(image: Image) -> Image:
    """Return an image that was made smaller and larger again."""
    rows, columns = image.shape[:2]
    small = cv2.resize(image, (columns * 3 // 5, rows * 3 // 5), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR))


def without_colour(image: Image) -> Image:
    """Return an image with a quarter of its colour, as in the format YUV 4:2:0."""
    luma, *colours = cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2YCrCb))
    size = luma.shape[::-1]
    half = [cv2.resize(c, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for c in colours]
    return np.asarray(
        cv2.cvtColor(cv2.merge([luma, *(cv2.resize(c, size) for c in half)]), cv2.COLOR_YCrCb2RGB)
    )


def sharpened(image: Image) -> Image:
    """Return an image with unsharp masking."""
    light = image.astype(np.float32)
    return to_levels(light + 0.7 * (light - cv2.GaussianBlur(light, (0, 0), 1.2)))


def interlaced(image: Image, first: int) -> Image:
    """Return an image in which every other row is that above it."""
    result = image.copy()
    rows = result[first + 1 :: 2]
    rows[:] = image[first : first + 2 * len(rows) : 2]
    return result


def to_levels(levels: Map) -> Image:
    """Return an image rounded to 8 bits."""
    return np.rint(levels).clip(0, 255).astype(np.uint8)


PROCESSED: dict[str, Callable[[Image], Image]] = {
    **{f"JPEG {quality}": lambda image, q=quality: jpeg(image, q) for quality in (30, 95)},
    "resized": resized,
    "4:2:0": without_colour,
    "sharpened": sharpened,
    "even rows twice": lambda image: interlaced(image, 0),
    "odd rows twice": lambda image: interlaced(image, 1),
    "median": lambda image: np.asarray(cv2.medianBlur(image, 3)),
    "blurred": lambda image: np.asarray(cv2.GaussianBlur(image, (0, 0), 1.0)),
    "moved during the exposure": lambda image: np.asarray(cv2.blur(image, (9, 1))),
    "palette": lambda image: to_levels(np.rint(image / 51.0) * 51.0),
}


@pytest.mark.parametrize("name", PROCESSED)
def test_a_processed_image_is_named_first_and_leaves_the_depth_doubtful(known, check, press, name):
    image = PROCESSED[name](known.noisy(press))
    for frame in (image, np.asarray(image / np.float32(255.0), np.float32)):
        found = check.check(frame)
        assert found.keys[0] == "compressed"
        assert found.findings[0].remedy
        # Of so few colours, nothing looks like the membrane.
        assert (found.meaningless is None) == (name != "palette")
        assert found.faults
        assert "blurred" not in found.keys
        assert "camera_moved" not in found.keys


def test_an_image_of_which_compression_leaves_nothing_is_refused_as_compressed(known, check, press):
    found = check.check(jpeg(known.noisy(press), 8)).meaningless
    assert found.key == "compressed"


def mean(known: ExactSensor, frame: Map, frames: int) -> Map:
    """Return the mean of noisy images, 0..255."""
    noisy = [known.noisy(frame, seed=seed) for seed in range(frames)]
    return np.asarray(np.mean(noisy, axis=0), np.float32)


@pytest.mark.parametrize("frames", [1, 4])
def test_a_mean_of_frames_is_not_processed(known, check, press, frames):
    averaged = mean(known, press, frames)
    for image in (
        np.rint(averaged).astype(np.uint8),
        averaged.astype(np.uint8),
        np.rint(257.0 * averaged).astype(np.uint16),
        np.asarray(averaged / 255.0, np.float32),
    ):
        assert "compressed" not in check.check(image).keys


def test_exposure_gain_and_images_without_noise_are_not_processed(known, check, press):
    noisy = known.noisy(press)
    more_noise = noisy + np.random.default_rng(0).normal(0.0, 2.0, noisy.shape)
    for image in (
        press,
        np.rint(255.0 * press).astype(np.uint8),
        known.noisy(press * np.float32(0.9)),
        known.noisy(press * np.float32(1.1)),
        np.rint(1.5 * noisy.astype(np.float32)).clip(0, 255).astype(np.uint8),
        np.rint(more_noise).clip(0, 255).astype(np.uint8),
    ):
        assert "compressed" not in check.check(image).keys


def of_noise(known: ExactSensor, frame: Map, sd: float, *, frames: int = 1) -> Map:
    """Return the mean of 8-bit images with white noise of a standard deviation in levels."""
    random = np.random.default_rng(frames)
    each = [to_levels(255.0 * frame + random.normal(0.0, sd, frame.shape)) for _ in range(frames)]
    return np.asarray(np.mean(each, axis=0), np.float32)


@pytest.mark.parametrize("sd", [0.15, 0.25, 0.5])
@pytest.mark.parametrize("frames", [1, 2, 4, 16])
def test_rounding_of_little_noise_is_no_processing(known, check, press, sd, frames):
    averaged = of_noise(known, press, sd, frames=frames)
    for image in (
        to_levels(averaged),
        averaged.astype(np.uint8),
        np.rint(257.0 * averaged).astype(np.uint16),
        np.asarray(averaged / 255.0, np.float32),
    ):
        assert "compressed" not in check.check(image).keys


@pytest.mark.parametrize("name", PROCESSED)
def test_processing_is_found_in_little_noise(known, press, name):
    frames = [
        known_press.on(known, BallIndenter(3.0, 0.8), x_mm=x, y_mm=y).frame for x, y in PLACES
    ]
    noisy = [to_levels(of_noise(known, frame, 0.45 + 1e-3 * n)) for n, frame in enumerate(frames)]
    image = to_levels(of_noise(known, press, 0.45))
    assert "compressed" not in check_with(known, noisy).check(image).keys
    assert "compressed" in check_with(known, noisy).check(PROCESSED[name](image)).keys


def test_grey_frames_of_half_the_exposure_and_of_a_lens_out_of_focus_are_healthy(
    known, check, press
):
    out_of_focus = np.asarray(cv2.GaussianBlur(press, (0, 0), 2.0))
    for frame in (0.5 * press, out_of_focus, np.repeat(press[..., :1], 3, axis=2)):
        assert "compressed" not in check.check(known.noisy(np.asarray(frame, np.float32))).keys


def test_a_calibration_of_an_earlier_program_still_finds_a_loss(known, balls, press):
    earlier = replace(measured(known, balls), coarse=None, colour_coarse=None, colour=None)
    check = HealthCheck(replace(known.calibration.data, grain=earlier))
    assert "compressed" in check.check(resized(known.noisy(press))).keys
    assert "compressed" not in check.check(known.noisy(press)).keys


def test_a_compressed_mean_of_frames_is_found_by_its_blocks(known, check, press):
    averaged = np.rint(mean(known, press, 16)).astype(np.uint8)
    assert "compressed" not in check.check(averaged).keys
    assert "compressed" in check.check(jpeg(averaged, 85)).keys


def test_a_camera_that_compresses_is_compared_with_its_own_images(known, balls, press):
    check = check_with(known, [jpeg(image, 90) for image in balls])
    image = known.noisy(press)
    assert "compressed" not in check.check(jpeg(image, 90)).keys
    assert "compressed" not in check.check(image).keys
    assert "compressed" in check.check(jpeg(image, 40)).keys


def test_without_the_grain_of_a_calibration_it_is_unknown(known, press):
    found = HealthCheck(known.calibration.data).check(jpeg(known.noisy(press), 50))
    assert "compressed" in found.unknown
    assert "compressed" not in found.keys
    too_few = grain_of([press, press], choose_samples(known.calibration.data).blocks)
    assert too_few is None


def test_lost_detail_leaves_the_depth_of_every_model_doubtful(known, balls, press):
    grain = measured(known, balls)
    # White noise: neighbours differ as distant pixels do.
    assert grain.ratio == pytest.approx(1.0, abs=0.05)
    assert grain.sd < 0.05
    paper = Reconstructor(known.calibration.changed(grain=grain), model="paper")
    doubts = paper.depth(jpeg(known.noisy(press), 50)).doubtful_findings
    assert any("processed the image" in doubt.text for doubt in doubts)
