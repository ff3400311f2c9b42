"""Bad pixels of the camera are found at calibration, kept in its file, and left out later."""

import shutil

import cv2
import numpy as np
import pytest
import scene

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND
from gelpolight_core.calibration.project import run_stage
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.image.bad_pixels import BadPixels
from gelpolight_core.session.session import read_session

COLUMN = 166


@pytest.fixture(scope="module")
def spoilt(small_session, tmp_path_factory):
    """Return the small session as a camera with a dead column would have made it."""
    folder = tmp_path_factory.mktemp("spoilt") / "session"
    shutil.copytree(small_session, folder)
    for stage in ("whiteboard", "background", "balls"):
        for path in (folder / stage).iterdir():
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            image[:, COLUMN] = 0
            cv2.imwrite(str(path), image)
    return folder


@pytest.mark.function("Leave out bad pixels of the camera")
def test_a_dead_column_is_found_and_left_out_of_background_and_presses(spoilt, small_project):
    session, before = read_session(spoilt), small_project.results
    results = run_stage(FULL, BACKGROUND, session, before)
    found = results[BACKGROUND]
    assert {int(c) for c in found.bad.pixels[:, 1]} == {COLUMN}
    assert len(found.bad.pixels) == found.bad.height
    assert "bad_pixels_percent" in [f.key for f in found.quality.figures]
    # The captures are those of another camera: the fingerprints of earlier stages differ.
    good = before[BACKGROUND].light
    inside = good.min(axis=2) > 0.1
    assert np.abs(found.light[inside] / good[inside] - 1.0).max() < 0.12
    balls = run_stage(FULL, BALLS, session, results)[BALLS].seen
    for ball, usual in zip(balls, before[BALLS].seen, strict=True):
        assert (ball.press is None) == (usual.press is None)
        if ball.image is not None and usual.image is not None:
            off = np.abs(ball.image - usual.image)[inside]
            assert np.quantile(off, 0.9999) < 0.05


def test_places_outside_the_image_are_a_damaged_file(tmp_path):
    huge = BadPixels(np.array([[5000, 5]], np.int32), 6000, 6000)
    write_calibration(scene.calibration().changed(bad=huge), tmp_path / "bad.gplcal")
    with pytest.raises(InputError, match="damaged"):
        read_calibration(tmp_path / "bad.gplcal")
