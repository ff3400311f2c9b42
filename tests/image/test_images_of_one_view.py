"""Images that are averaged must show the same: an image of an earlier calibration does not."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.image.change_detection import FLICKER, find_odd_image
from gelpolight_core.session.session import SensorData, Session

ROWS, COLUMNS = 240, 320
MIRROR, MEMBRANE = "mirror", "background"


def view(stage: str, shift_px: float = 0.0) -> np.ndarray:
    """Return the light (rows, columns, 3): three spots of LEDs, or a lit membrane in its housing.

    The image is moved sideways.
    """
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    x = x - shift_px
    if stage == MIRROR:
        places = [(90.0, 80.0), (220.0, 90.0), (160.0, 190.0)]
        spots = [np.exp(-0.5 * ((x - u) ** 2 + (y - v) ** 2) / 2.5**2) for u, v in places]
        return np.asarray(0.8 * np.stack(spots, -1) + 0.004)
    glow = np.stack([0.15 + 0.5 * x / COLUMNS, 0.4 - 0.2 * y / ROWS, 0.1 + 0.3 * y / ROWS], -1)
    housing = np.clip(110.0 - np.hypot(x - 160.0, y - 120.0), 0.0, 1.0)
    return np.asarray(glow * housing[..., None])


def shot(
    light: np.ndarray, random: np.random.Generator, *, noise: float = 0.005, jpeg: int = 0
) -> np.ndarray:
    """Return the image of a camera of 8 bits with shot noise, `noise` at full light."""
    seen = light + noise * np.sqrt(0.1 + light) * random.normal(size=light.shape)
    image = np.round(255.0 * np.clip(seen, 0.0, 1.0)).astype(np.uint8)
    if jpeg:
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg])
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return image.astype(np.float32) / np.float32(255.0)


def hot_pixels(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the image with bright single pixels at other places in each image."""
    rows, columns = random.integers(0, ROWS, 5), random.integers(0, COLUMNS, 5)
    image[rows, columns] = 1.0
    return image


@settings(max_examples=25)
@given(
    st.sampled_from([MIRROR, MEMBRANE]),
    st.integers(2, 16),
    st.sampled_from([0.0, 0.003, 0.01, 0.03]),
    st.sampled_from([0, 95, 75]),
    st.integers(0, 10_000),
)
def test_repeated_images_are_averaged(stage, count, noise, jpeg, seed):
    """LEDs flicker by a few percent, the sensor shakes by a pixel, pixels of the camera blink."""
    random = np.random.default_rng(seed)
    images = []
    for _ in range(count):
        flicker = 1.0 + 0.3 * FLICKER * random.uniform(-1.0, 1.0, 3)
        light = flicker * view(stage, random.uniform(-0.7, 0.7))
        images.append(hot_pixels(shot(light, random, noise=noise, jpeg=jpeg), random))
    # As the quantisation of that quality.
    assert find_odd_image(images, loss={0: 0.0, 95: 2.0, 75: 9.0}[jpeg] / 255.0) is None


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(
    ("stage", "gain", "shift_px"),
    [
        (MIRROR, 1.0, 12.0),
        (MIRROR, 1.0, -6.0),
        (MEMBRANE, 1.0, 4.0),
        (MEMBRANE, (0.9, 1.0, 1.05), 0.0),
        (MEMBRANE, 0.85, 0.0),
        (MEMBRANE, 1.15, 0.0),
    ],
)
def test_an_image_of_an_earlier_calibration_is_found_among_any_number(stage, gain, shift_px, noise):
    random = np.random.default_rng(3)
    old = shot(gain * view(stage, shift_px), random, noise=noise)
    for count in (1, 2, 9):
        images = [shot(view(stage), random, noise=noise) for _ in range(count)]
        found = find_odd_image([*images[1:], old, images[0]])
        assert found is not None
        assert count - 1 in found
        if count > 1:
            assert found[0] == count - 1


def test_the_message_names_both_files(tmp_path):
    random = np.random.default_rng(1)
    (tmp_path / "mirror").mkdir()
    for name, shift_px in {"old_00": 12.0, "mirror_00": 0.0, "mirror_01": 0.0}.items():
        image = np.round(255.0 * shot(view(MIRROR, shift_px), random)).astype(np.uint8)
        assert cv2.imwrite(str(tmp_path / f"mirror/{name}.png"), image[..., ::-1])
    session = Session(tmp_path, SensorData("s"))
    with pytest.raises(InputError, match=r"^mirror: old_00\.png and mirror_0.\.png differ"):
        session.averaged("mirror")
    (tmp_path / "mirror/old_00.png").unlink()
    assert Session(tmp_path, SensorData("s")).averaged("mirror").frame_count == 2


@pytest.mark.parametrize("stage", ["mirror", "background", "whiteboard"])
def test_images_of_a_rendered_sensor(shared_data, stage):
    """Its own image repeated, and an earlier one: the light 15 % less, or moved by 12 px."""
    (path,) = (shared_data / "sensor-B" / stage).glob("*.png")
    light = cv2.imread(str(path))[..., ::-1] / np.float32(255.0)
    random = np.random.default_rng(0)
    same = [shot(light, random, noise=0.01) for _ in range(3)]
    assert find_odd_image(same) is None
    old = np.roll(light, 12, axis=1) if stage == "mirror" else 0.85 * light
    found = find_odd_image([*same, shot(old, random, noise=0.01)])
    assert found is not None
    assert found[0] == 3
