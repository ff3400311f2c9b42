"""Bad pixels of the camera are found at calibration, kept in its file, and left out later."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.bad_pixels import BadPixels
from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.stages import run_stage
from gelpolight_core.errors import InputError
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session

COLUMN = 333


@pytest.fixture(scope="module")
def spoilt(virtual_session: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the virtual session as a camera with a dead column would have made it."""
    folder = tmp_path_factory.mktemp("spoilt") / "session"
    shutil.copytree(virtual_session, folder)
    for stage in ("whiteboard", "background", "balls"):
        for path in (folder / stage).iterdir():
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            image[:, COLUMN] = 0
            cv2.imwrite(str(path), image)
    return folder


def test_a_dead_column_is_found_and_left_out_of_background_and_presses(
    spoilt: Path, virtual_results: StageResults
) -> None:
    session = read_session(spoilt)
    results = run_stage(Stage.BACKGROUND, session, virtual_results)
    assert results.bad is not None
    assert {int(c) for c in results.bad.pixels[:, 1]} == {COLUMN}
    assert len(results.bad.pixels) == results.bad.height
    assert results.bare_membrane is not None
    assert "bad_pixels_percent" in [f.key for f in results.bare_membrane.figures]
    # The captures are those of another camera: the fingerprints of earlier stages differ.
    good = virtual_results.background
    assert good is not None and results.background is not None
    inside = good.min(axis=2) > 0.1
    assert np.abs(results.background[inside] / good[inside] - 1.0).max() < 0.12
    balls = run_stage(Stage.BALLS, session, results).balls
    for ball, before in zip(balls, virtual_results.balls, strict=True):
        assert (ball.press is None) == (before.press is None)
        if ball.image is not None and before.image is not None:
            off = np.abs(ball.image - before.image)[inside]
            assert np.quantile(off, 0.9999) < 0.05


def test_the_map_is_kept_in_the_file_and_files_without_one_are_read(
    small_calibration: Calibration, tmp_path: Path
) -> None:
    camera = small_calibration.camera
    bad = BadPixels(np.array([[3, 5], [3, 6]], np.int32), camera.height, camera.width)
    kept = replace(small_calibration, bad=bad)
    write_calibration(kept, tmp_path / "kept.gplcal")
    again = read_calibration(tmp_path / "kept.gplcal")
    assert again.bad is not None
    assert np.array_equal(again.bad.pixels, bad.pixels)
    assert again.identity == kept.identity != small_calibration.identity
    write_calibration(small_calibration, tmp_path / "without.gplcal")
    without = read_calibration(tmp_path / "without.gplcal")
    assert without.bad is None
    assert not without.bad_pixels.pixels.size
    assert without.identity == small_calibration.identity


def test_places_outside_the_image_are_a_damaged_file(
    small_calibration: Calibration, tmp_path: Path
) -> None:
    huge = BadPixels(np.array([[5000, 5]], np.int32), 6000, 6000)
    write_calibration(replace(small_calibration, bad=huge), tmp_path / "bad.gplcal")
    with pytest.raises(InputError, match="damaged"):
        read_calibration(tmp_path / "bad.gplcal")
