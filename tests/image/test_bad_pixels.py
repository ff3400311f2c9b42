"""Dead and hot pixels are found once, kept, and left out of everything that follows."""

import numpy as np
import pytest

from gelpolight_core import read_image
from gelpolight_core.image.bad_pixels import (
    ACROSS,
    DOWN,
    BadPixels,
    differing_pixels,
    find_bad_pixels,
    no_bad_pixels,
    threads_of,
)

HEIGHT, WIDTH = 60, 80


def scene(seed: int) -> np.ndarray:
    """Return an image whose light runs across it, with noise."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices((HEIGHT, WIDTH))
    light = 0.3 + 0.3 * (rows / HEIGHT if seed % 2 else columns / WIDTH)
    return np.asarray(light[..., None] + rng.normal(0.0, 0.004, (HEIGHT, WIDTH, 3)), np.float32)


def spoilt(image: np.ndarray) -> np.ndarray:
    """Return it from a camera with a dead column, a hot row and two bad pixels."""
    image = image.copy()
    image[:, 30] = 0.0
    image[41, :] = 1.0
    image[10, 50] = 1.0
    image[20, 60, 1] = 0.0
    return image


def test_lines_and_pixels_are_found_and_nothing_else():
    found = find_bad_pixels([spoilt(scene(0)), spoilt(scene(1))])
    wanted = np.zeros((HEIGHT, WIDTH), bool)
    wanted[:, 30] = wanted[41, :] = wanted[10, 50] = wanted[20, 60] = True
    assert (found.mask == wanted).all()
    assert not find_bad_pixels([scene(0), scene(1)]).pixels.size


@pytest.mark.parametrize("share", [0.0005, 0.002, 0.003, 0.01, 0.03, 0.1])
def test_hot_pixels_are_found_however_many(share):
    hot = np.random.default_rng(5).random((HEIGHT, WIDTH)) < share
    hot[:2] = hot[-2:] = hot[:, :2] = hot[:, -2:] = False
    scenes = [np.where(hot[..., None], np.float32(1.0), scene(n)) for n in (0, 1)]
    found = find_bad_pixels(scenes).mask
    assert not (found & ~hot).any()
    # All but those that touch another one along a row or a column.
    beside = sum(np.roll(hot, step, axis) for axis in (0, 1) for step in (-2, -1, 1, 2))
    assert hot.any() and found[hot & (beside == 0)].all()


@pytest.mark.parametrize("sensor", ["sensor-A", "sensor-B", "sensor-C", "real/closed/mini-1"])
def test_images_of_healthy_cameras_show_no_share_of_hot_pixels(shared_data, sensor):
    light = np.tile(np.linspace(0.0, 1.0, 256, dtype=np.float32), (3, 1))
    for path in sorted(shared_data.glob(f"{sensor}/[bp]*s/*.png")):
        image = read_image(path)
        marks = differing_pixels(image, light, np.arange(len(image)), noise=0.0)
        assert (marks == (ACROSS | DOWN)).mean() < 1e-4, path


def test_bad_pixels_beside_each_other_are_found():
    image = scene(0)
    for row, column in ((10, 20), (10, 21), (30, 40), (31, 40), (50, 60), (50, 61), (51, 60)):
        image[row, column] = 1.0
    image[20, 50] = image[21, 50] = 0.0
    image[40, 10] = 0.0
    bad = find_bad_pixels([image]).mask
    assert bad.sum() == 10
    assert bad[image[..., 1] == 1.0].all()
    assert bad[image[..., 1] == 0.0].all()


def test_dirt_in_one_scene_and_specks_are_no_bad_pixels():
    dirty, clean = scene(0), scene(1)
    dirty[10, 50] = 0.0
    assert not find_bad_pixels([dirty, clean]).pixels.size
    for image in (dirty, clean):
        image[30:36, 40:46] *= 0.5
    assert not find_bad_pixels([dirty, clean]).pixels.size


@pytest.mark.parametrize("kind", [np.float32, np.uint8, np.uint16])
def test_what_is_left_out_becomes_what_the_neighbours_show(kind):
    top = 1.0 if kind is np.float32 else np.iinfo(kind).max
    clean, other = (np.asarray(scene(n) * top, kind) for n in (0, 1))
    bad = [np.asarray(spoilt(scene(n)) * top, kind) for n in (0, 1)]
    found = find_bad_pixels([spoilt(scene(0)), spoilt(scene(1))])
    mended = found.fill_bad_pixels(bad[0])
    assert mended.dtype == kind
    assert np.abs(mended / top - clean / top).max() < 0.04
    # The image itself is the caller's.
    assert bad[0][10, 50, 0] == top
    assert no_bad_pixels(HEIGHT, WIDTH).fill_bad_pixels(other) is other


def test_places_outside_the_image_are_refused():
    with pytest.raises(ValueError, match="outside"):
        BadPixels(np.array([[60, 3]], np.int32), HEIGHT, WIDTH)


def bad_at(*places: tuple[int, int]) -> BadPixels:
    return BadPixels(np.array(places, np.int32), HEIGHT, WIDTH)


NO_LINES = np.zeros(0, np.intp)


def test_a_chain_of_pixels_is_a_hair_and_alone_pixels_and_lines_are_not():
    hair = [(20 + n, 30 + n // 2) for n in range(12)]
    alone = [(5, 5), (5, 6), (6, 5), (50, 70), (40, 10)]
    found = threads_of(bad_at(*hair, *alone), NO_LINES, NO_LINES)
    assert sorted(map(tuple, np.argwhere(found).tolist())) == sorted(hair)
    column = [(row, 44) for row in range(HEIGHT)]
    half_of_one = [(row, 12) for row in range(HEIGHT // 3)]
    lines = bad_at(*column, *half_of_one, *alone)
    assert not threads_of(lines, np.array([44]), NO_LINES).any()


@pytest.mark.parametrize("share", [0.003, 0.03, 0.1])
def test_many_bad_pixels_form_no_hair_by_chance(share):
    for seed in range(20):
        places = np.argwhere(np.random.default_rng(seed).random((HEIGHT, WIDTH)) < share)
        bad = BadPixels(places.astype(np.int32), HEIGHT, WIDTH)
        assert not threads_of(bad, NO_LINES, NO_LINES).any()
