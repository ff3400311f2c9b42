"""A raw image of a camera differs from a grey one by the mosaic of its colours."""

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.image.mosaic import WINDOW_PX, is_mosaic
from gelpolight_core.session.session_images import read_colours, read_linear_image

ROWS, COLUMNS = 150, 210
Y, X = np.mgrid[:ROWS, :COLUMNS]
LAYOUTS = ("RGGB", "BGGR", "GRBG", "GBRG")


def lit_scene(noise: float) -> np.ndarray:
    """Return a scene lit by a red LED on the right, a green one above and a blue one on the left.

    Red and blue are equal along a line, beside which their difference has either sign.
    """
    rgb = np.stack([0.2 + 0.4 * X / COLUMNS, 0.6 - 0.3 * Y / ROWS, 0.5 - 0.3 * X / COLUMNS], -1)
    return rgb + noise * np.random.default_rng(0).standard_normal(rgb.shape)


def mosaic(rgb: np.ndarray, layout: str) -> np.ndarray:
    """Return the one colour that each pixel of a camera has."""
    channel = np.array(["RGB".index(colour) for colour in layout]).reshape(2, 2)
    return np.take_along_axis(rgb, channel[Y % 2, X % 2][..., None], axis=2)[..., 0]


def eight_bit(light: np.ndarray) -> np.ndarray:
    return np.round(255.0 * np.clip(light, 0.0, 1.0)).astype(np.uint8)


def stripes(period_px: float, angle_deg: float) -> np.ndarray:
    angle = np.radians(angle_deg)
    place = X * np.cos(angle) + Y * np.sin(angle)
    return 0.5 + 0.3 * np.cos(2.0 * np.pi * place / period_px + 0.4)


@pytest.mark.function("Be told that an image is raw (Bayer) data of the camera")
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_raw_image_is_refused_as_such_where_colour_is_needed(tmp_path, layout):
    path = tmp_path / "raw.png"
    cv2.imwrite(str(path), eight_bit(mosaic(lit_scene(0.01), layout)))
    assert read_linear_image(path).grey
    with pytest.raises(InputError, match=r"raw \(Bayer\) data .* Demosaic it"):
        read_colours(path)
    cv2.imwrite(str(path), eight_bit(lit_scene(0.01))[..., 1])
    with pytest.raises(InputError, match=r"The image is grey\. Capture it in colour"):
        read_colours(path)


def test_a_raw_tiff_that_says_so_is_refused_as_such(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    tifffile.imwrite(
        tmp_path / "raw.tif", eight_bit(mosaic(lit_scene(0.01), "GRBG")), photometric="cfa"
    )
    with pytest.raises(InputError, match=r"raw \(Bayer\) data"):
        read_colours(tmp_path / "raw.tif")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_red_and_blue_must_differ_by_more_than_the_noise_between_two_pixels(layout):
    """In every layout, whatever the green. The noise between two pixels is 0.01 by root 2."""
    for difference, found in ((0.005, False), (0.04, True)):
        rgb = np.broadcast_to([0.3, 0.6, 0.3 + difference], (ROWS, COLUMNS, 3))
        noisy = rgb + 0.01 * np.random.default_rng(1).standard_normal(rgb.shape)
        assert is_mosaic(mosaic(noisy, layout).astype(np.float32)) is found


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("period_px", [2.0, 2.02, 2.2, 2.5, 3.0, 4.0, 8.0])
@pytest.mark.parametrize("angle_deg", [0.0, 15.0, 45.0, 90.0, 120.0])
def test_fine_stripes_are_no_mosaic(noise, period_px, angle_deg):
    """Along diagonals also such that neighbours differ more than pixels two apart on both axes."""
    for period in (period_px, period_px * np.sin(np.pi / 4.0)):
        light = stripes(period, angle_deg) + noise * np.random.default_rng(2).standard_normal(
            X.shape
        )
        assert not is_mosaic((eight_bit(light) / 255.0).astype(np.float32))


def test_texture_noise_and_edges_are_no_mosaic():
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(X.shape)
    scenes = [0.5 + 0.0 * X, 0.5 + 0.1 * noise, 0.1 + 0.8 * X / COLUMNS]
    for sigma_px in (0.4, 0.7, 1.5, 4.0):
        blurred = cv2.GaussianBlur(noise, (0, 0), sigma_px)
        scenes.append(0.5 + 0.15 * blurred / blurred.std())
    scenes += [0.1 + 0.8 * ((X // side + Y // side) % 2) for side in (1, 2, 3, 20)]
    scenes.append(np.kron(rng.random((ROWS // 2, COLUMNS // 2)), np.ones((2, 2))))
    for scene in scenes:
        assert not is_mosaic((eight_bit(scene) / 255.0).astype(np.float32))


def test_an_image_too_small_to_tell_is_no_mosaic():
    tiny = mosaic(lit_scene(0.0), "RGGB")[: WINDOW_PX - 1].astype(np.float32)
    assert not is_mosaic(tiny)
    assert not is_mosaic(tiny[:2, :2])
