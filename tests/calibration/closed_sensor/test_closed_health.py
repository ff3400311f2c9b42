"""Faults of a closed sensor's images, and backgrounds that do not fit exactly."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core import measure
from gelpolight_core.base.errors import InputError
from gelpolight_core.image.linear_image import linear_image
from gelpolight_core.measurement.measurable_depth import measurable_depth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import read_raw_image

Frame = NDArray[np.uint8]
Map = NDArray[Any]


@pytest.fixture(scope="module")
def reconstructor(closed_run):
    return Reconstructor(closed_run.calibration)


@pytest.fixture(scope="module")
def presses(closed_folder):
    return [read_raw_image(path)[0] for path in sorted((closed_folder / "balls").glob("*.png"))]


def changed(frame: Frame, light: Map | tuple[float, ...], room: float = 0.0) -> Frame:
    """Return a frame with other light: factors of its channels or pixels, and room light."""
    return np.clip(np.rint(frame * np.asarray(light) + 255.0 * room), 0, 255).astype(np.uint8)


def vignetting(share: float, shape: tuple[int, ...]) -> Map:
    """Return the light (rows, columns, 1) that falls by a share to the image's corners."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    half = np.array(shape[:2]) - 1.0
    size = (2.0 * y / half[0] - 1.0) ** 2 + (2.0 * x / half[1] - 1.0) ** 2
    return (1.0 - 0.5 * share * size)[..., None]


def test_healthy_presses_have_no_fault(reconstructor, presses):
    for frame in presses:
        found = reconstructor.health(frame)
        assert found.keys == ()
        assert found.light.share == pytest.approx(np.ones(3), abs=0.002)


@pytest.mark.parametrize(
    ("light", "key"),
    [
        ((0.8, 0.8, 0.8), "exposure"),
        ((1.05, 1.05, 1.05), "exposure"),
        ((0.95, 1.0, 1.0), "led_weak"),
        ((1.0, 1.0, 1.2), "led_weak"),
    ],
)
def test_a_change_of_the_light_is_stated_and_corrected(reconstructor, presses, light, key):
    for frame in presses[:2]:
        alone = measure(reconstructor.depth(frame, uncertainty=True), shape="ball")
        found = reconstructor.depth(changed(frame, light), uncertainty=True)
        assert [finding.key for finding in found.findings] == [key]
        assert not found.doubtful_findings
        ball = measure(found, shape="ball")
        assert ball.diameter_mm == pytest.approx(
            alone.diameter_mm, abs=0.5 * alone.sd["diameter_mm"]
        )
        assert ball.height_mm == pytest.approx(alone.height_mm, abs=0.5 * alone.sd["height_mm"])


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_vignetting_of_a_closed_sensor_is_corrected_or_doubtful(reconstructor, presses, share):
    for frame in presses[:2]:
        alone = measure(reconstructor.depth(frame, uncertainty=True), shape="ball")
        shaded = changed(frame, vignetting(share, frame.shape))
        found = reconstructor.depth(shaded, uncertainty=True)
        assert "uneven" in [finding.key for finding in found.findings]
        ball = measure(found, shape="ball")
        off = abs(ball.diameter_mm - alone.diameter_mm) / alone.sd["diameter_mm"]
        assert found.doubtful_findings or off < 1.0


@pytest.mark.parametrize(
    ("key", "damage"),
    [
        ("room_light", lambda frame: changed(frame, (1.0,), room=0.01)),
        ("blurred", lambda frame: cv2.GaussianBlur(frame, (0, 0), 1.5)),
        ("camera_moved", lambda frame: np.roll(frame, 2, axis=1)),
        ("camera_moved", lambda frame: np.roll(frame, 6, axis=1)),
    ],
)
def test_what_cannot_be_corrected_is_doubtful_and_named_first(reconstructor, presses, key, damage):
    for frame in presses[:2]:
        seen = damage(frame)
        found = reconstructor.depth(seen, uncertainty=True, health=reconstructor.health(seen))
        assert found.doubtful_findings[0].key == key
        try:
            assert measure(found, shape="ball").verdict == "doubtful"
        except InputError as error:
            assert error.found.startswith(found.doubtful_findings[0].text)


def test_a_calibration_of_an_earlier_program_judges_and_corrects_as_before(closed_run, presses):
    model = replace(closed_run.calibration.data.in_place, press_light=None)
    earlier = Reconstructor(closed_run.calibration.changed(in_place=model))
    health = earlier.health(changed(presses[0], (0.8, 0.9, 1.0)))
    assert health.keys == () and "exposure" in health.unknown
    assert health.light.share == pytest.approx([0.8, 0.9, 1.0], abs=0.002)


@pytest.mark.parametrize(
    ("key", "share"), [("dark", (0.02, 0.02, 0.02)), ("led_off", (1.0, 1.0, 0.0))]
)
def test_images_without_light_are_refused(reconstructor, presses, key, share):
    frame = np.rint(presses[0] * np.array(share)).astype(np.uint8)
    assert reconstructor.health(frame).keys == (key,)
    with pytest.raises(InputError):
        measurable_depth(reconstructor, linear_image(frame, "press"))


@pytest.mark.parametrize("order", [(2, 1, 0), (1, 2, 0), (0, 2, 1)])
def test_colours_in_another_order_are_refused(reconstructor, presses, order):
    for frame in presses[::4]:
        assert reconstructor.health(frame[..., order]).keys == ("colour_order",)


def test_a_compressed_image_is_named(reconstructor, presses, tmp_path):
    assert reconstructor.calibration.data.grain is not None
    for quality in (50, 90):
        path = str(tmp_path / f"{quality}.jpg")
        cv2.imwrite(path, presses[0][..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        seen = cv2.imread(path)
        found = reconstructor.health(np.ascontiguousarray(seen[..., ::-1]))
        assert found.keys == ("compressed",)
        assert found.faults
        assert found.meaningless is None


@pytest.mark.parametrize("value", [0, 255])
def test_hot_and_dead_pixels_are_named_and_left_out(reconstructor, presses, value):
    frame = presses[0].copy()
    frame[np.random.default_rng(0).random(frame.shape[:2]) < 0.01] = value
    assert "bad_pixels" in reconstructor.health(frame).keys
    clean, found = reconstructor.depth(presses[0]), reconstructor.depth(frame)
    assert found.doubtful_findings
    assert np.abs(found.depth_mm - clean.depth_mm).max() < 0.02 * clean.depth_mm.max()


def at_place(frame: Frame, x_share: float, y_share: float) -> tuple[Map, Map]:
    """Return the distances (rows, columns) from a place, in widths of the image."""
    y, x = np.mgrid[: frame.shape[0], : frame.shape[1]] / frame.shape[1]
    return x - x_share, y - y_share


def test_a_hair_is_named_and_left_out(reconstructor, presses):
    x, y = at_place(presses[0], 0.5, 0.3)
    on_hair = (np.abs(y - 0.9 * x) < 0.0016) & (np.abs(x) < 0.08)
    frame = changed(presses[0], np.where(on_hair, 0.2, 1.0)[..., None])
    (fault,) = reconstructor.health(frame).faults
    assert fault.key == "hair"
    clean, found = reconstructor.depth(presses[0]), reconstructor.depth(frame)
    assert np.abs(found.depth_mm - clean.depth_mm).max() < 0.02 * clean.depth_mm.max()


def test_light_that_no_surface_sends_is_found_by_its_slopes(reconstructor, presses):
    """Slopes of a surface have no rotation; a spot of sunlight has."""
    for frame in presses[:3]:
        found = reconstructor.depth(frame, uncertainty=True)
        assert "residual" not in [finding.key for finding in found.findings]
        x, y = at_place(frame, 0.6, 0.3)
        glare = 60.0 * np.exp(-0.5 * (np.hypot(x, y) / 0.06) ** 2)[..., None]
        lit = np.clip(frame + glare, 0, 255).astype(np.uint8)
        spoiled = reconstructor.depth(lit, uncertainty=True)
        (residual,) = [f for f in spoiled.doubtful_findings if f.key == "residual"]
        assert residual.value > 3.0
        try:
            assert measure(spoiled, shape="ball").verdict == "doubtful"
        except InputError as error:
            assert residual.text in error.found
