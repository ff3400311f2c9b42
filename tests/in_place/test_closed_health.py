"""Faults of a closed sensor's images, and backgrounds that do not fit exactly."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.calibration.project import Run, calibrate
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import read_raw_image
from gelpolight_core.session.session import read_session

Frame = NDArray[np.uint8]


@pytest.fixture(scope="module")
def reconstructor(closed_run: Run) -> Reconstructor:
    return Reconstructor(closed_run.calibration)


@pytest.fixture(scope="module")
def presses(closed_folder: Path) -> list[Frame]:
    return [read_raw_image(path)[0] for path in sorted((closed_folder / "balls").glob("*.png"))]


def test_presses_and_another_exposure_have_no_fault(
    reconstructor: Reconstructor, presses: list[Frame]
) -> None:
    for frame in presses:
        assert reconstructor.health(frame).keys == ()
    darker = np.rint(0.8 * presses[0]).astype(np.uint8)
    assert reconstructor.health(darker).keys == ()


@pytest.mark.parametrize(
    ("key", "share"), [("dark", (0.02, 0.02, 0.02)), ("led_off", (1.0, 1.0, 0.0))]
)
def test_images_without_light_are_refused(
    reconstructor: Reconstructor, presses: list[Frame], key: str, share: tuple[float, ...]
) -> None:
    frame = np.rint(presses[0] * np.array(share)).astype(np.uint8)
    assert reconstructor.health(frame).keys == (key,)
    with pytest.raises(InputError):
        measurable_depth(reconstructor, frame, name="press")


@pytest.mark.parametrize("order", [(2, 1, 0), (1, 2, 0), (0, 2, 1)])
def test_colours_in_another_order_are_refused(
    reconstructor: Reconstructor, presses: list[Frame], order: tuple[int, ...]
) -> None:
    for frame in presses:
        assert reconstructor.health(frame[..., order]).keys == ("colour_order",)


def test_a_compressed_image_is_named(
    reconstructor: Reconstructor, presses: list[Frame], tmp_path: Path
) -> None:
    assert reconstructor.calibration.data.grain is not None
    for quality in (50, 90):
        path = str(tmp_path / f"{quality}.jpg")
        cv2.imwrite(path, presses[0][..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        seen = cv2.imread(path)
        assert seen is not None
        found = reconstructor.health(np.ascontiguousarray(seen[..., ::-1]))
        assert found.keys == ("compressed",)
        assert found.faults
        assert found.meaningless is None


def test_hot_pixels_are_named(reconstructor: Reconstructor, presses: list[Frame]) -> None:
    frame = presses[0].copy()
    frame[np.random.default_rng(0).random(frame.shape[:2]) < 0.01] = 255
    assert "bad_pixels" in reconstructor.health(frame).keys


def test_colours_of_a_real_sensor_in_another_order_are_refused(shared_data: Path) -> None:
    folder = shared_data / "real" / "closed" / "mini-1"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    reconstructor = Reconstructor(calibrate(read_session(folder)).calibration)
    for path in sorted((folder / "balls").glob("*.png"))[::6]:
        frame = read_raw_image(path)[0]
        assert reconstructor.health(frame).keys == ()
        assert reconstructor.health(frame[..., ::-1]).keys == ("colour_order",)


def test_a_gel_that_drags_its_texture_is_calibrated(shared_data: Path, tmp_path: Path) -> None:
    folder = shared_data / "cases" / "dragged-texture"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    shutil.copytree(folder, tmp_path / "session")
    table = calibrate(read_session(tmp_path / "session")).calibration.quality["in_place"]
    found = {figure.key: figure.value for figure in table.figures}
    assert found["held_out_normal_deg"] < 2.0
    assert found["held_out_diameter_percent"] < 1.0
