"""An image that was compressed, resized or filtered lacks detail; a mean of frames does not."""

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


LOST: dict[str, Callable[[Image], Image]] = {
    **{f"JPEG {quality}": lambda image, q=quality: jpeg(image, q) for quality in (30, 95)},
    "resized": resized,
}


@pytest.mark.parametrize("name", LOST)
def test_lost_detail_is_named_first_and_leaves_the_depth_doubtful(known, check, press, name):
    found = check.check(LOST[name](known.noisy(press)))
    assert found.keys[0] == "compressed"
    assert found.findings[0].remedy
    assert found.meaningless is None
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
def test_a_mean_of_frames_has_lost_nothing(known, check, press, frames):
    averaged = mean(known, press, frames)
    for image in (
        np.rint(averaged).astype(np.uint8),
        averaged.astype(np.uint8),
        np.rint(257.0 * averaged).astype(np.uint16),
        np.asarray(averaged / 255.0, np.float32),
    ):
        assert "compressed" not in check.check(image).keys


def test_exposure_gain_and_images_without_noise_have_lost_nothing(known, check, press):
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
    assert any("fine detail" in doubt.text for doubt in doubts)
