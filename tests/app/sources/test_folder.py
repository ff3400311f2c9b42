"""A folder of images is replayed in the order of the file names."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.inspect.export import frame_name
from app.sources.source import SourceFrame
from app.sources.source_list import FolderSource, next_image
from gelpolight_core.base.errors import InputError


def image(number: int, *, kind: type = np.uint8, size: tuple[int, int] = (320, 240)) -> np.ndarray:
    """Return an image that encodes its number."""
    rng = np.random.default_rng(number)
    return rng.integers(0, np.iinfo(kind).max, (size[1], size[0], 3), kind, endpoint=True)


def write(path: Path, rgb: np.ndarray) -> None:
    assert cv2.imwrite(str(path), rgb[..., ::-1])


def following(source: FolderSource) -> SourceFrame:
    frame = source.frame(1.0)
    return frame


@pytest.fixture
def folder(tmp_path):
    """Return a folder with three images and another file."""
    for number, name in enumerate(["a.png", "b.TIFF", "c.png"]):
        write(tmp_path / name, image(number))
    (tmp_path / "notes.txt").write_text("not an image")
    return tmp_path


@pytest.mark.function("Use a folder of images as the source")
def test_images_repeat_in_the_order_of_their_names(folder):
    source = FolderSource(folder)
    source.open()
    source.play()
    for number in range(5):
        frame = following(source)
        assert frame.rgb.shape == (240, 320, 3)
        assert frame.number == number
        assert np.array_equal(frame.rgb, image(number % 3))
    source.close()


def test_a_folder_stays_at_a_file_until_stepped_and_names_it(folder):
    source = FolderSource(folder)
    source.open()
    for step, name in ((0, "a.png"), (0, "a.png"), (1, "b.TIFF"), (1, "c.png"), (1, "c.png")):
        if step:
            source.step(step)
        frame = following(source)
        assert frame.name == source.playback().file == name
        assert frame_name(frame) == f"{Path(name).stem}.png"
        assert frame.paused
        assert np.array_equal(frame.rgb, image("abc".index(name[0])))
    source.close()
    assert next_image(folder / "a.png") == folder / "b.TIFF"
    assert next_image(folder / "c.png") is None


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bit_images_keep_every_value(tmp_path, suffix):
    rgb = image(0, kind=np.uint16)
    write(tmp_path / f"deep{suffix}", rgb)
    source = FolderSource(tmp_path)
    source.open()
    frame = following(source)
    assert frame.rgb.dtype == np.uint16
    assert np.array_equal(frame.rgb, rgb)


def test_an_image_of_another_size_is_rejected_by_name(folder):
    write(folder / "d.png", image(3, size=(160, 120)))
    source = FolderSource(folder)
    source.open()
    following(source)
    source.seek(3)
    with pytest.raises(InputError, match=r"d\.png: the image has 160x120 pixels"):
        source.frame(1.0)


def test_a_damaged_image_and_a_folder_without_images_are_rejected(folder, tmp_path):
    (folder / "a.png").write_bytes((folder / "a.png").read_bytes()[:200])
    (tmp_path / "empty").mkdir()
    for place, words in (
        (folder, r"a\.png"), (tmp_path / "empty", "no images"), (tmp_path / "missing", "no images"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            FolderSource(place).open()
