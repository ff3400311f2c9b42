"""A whole session with one fault: the user gets the right message, and only that one."""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.open_sensor_recipe import RADIANCE
from gelpolight_core.calibration.project import assemble, run_calibration, run_stage
from gelpolight_core.calibration.recipes import FULL, PAPER
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_session


@pytest.fixture
def session(small_session, tmp_path):
    """Return a copy of the small session for modification."""
    ignored = shutil.ignore_patterns("presses", "truth")
    return Path(shutil.copytree(small_session, tmp_path / "session", ignore=ignored))


@pytest.mark.function("Recognise a copied image")
def test_a_copied_image_is_refused_for_every_caller(session):
    shutil.copy(session / "background" / "background.png", session / "whiteboard/whiteboard.png")
    with pytest.raises(InputError, match="copy of"):
        run_calibration(read_session(session))


def test_a_whiteboard_too_dim_for_the_balls_is_named(session, small_project):
    """A tenth of the light: the board is detected, but hardly any ball press."""
    path = session / "whiteboard" / "whiteboard.png"
    image = cv2.imread(str(path))
    assert image is not None
    cv2.imwrite(str(path), np.round(0.1 * image).astype(np.uint8))
    changed, results = read_session(session), small_project.results
    for stage in PAPER.stages[PAPER.stages.index(RADIANCE) :]:
        results = run_stage(PAPER, stage, changed, results)
    quality = assemble(PAPER, changed, results).calibration.quality
    assert quality["radiance"].verdict is Verdict.FAIL
    assert "whiteboard" in quality["balls"]["balls_left_out"].remedy


def test_the_grain_of_the_ball_presses_is_in_the_calibration(small_project):
    calibration = assemble(FULL, small_project.session, small_project.results).calibration
    grain = calibration.data.grain
    assert grain.ratio == pytest.approx(1.0, abs=0.1)
    reconstructor = Reconstructor(calibration)
    for path in small_project.session.files("balls"):
        seen = cv2.imread(str(path))
        found = reconstructor.health(np.ascontiguousarray(seen[..., ::-1]))
        assert "compressed" not in found.keys
        assert "compressed" not in found.unknown


def test_names_that_are_not_text_make_a_calibration_that_can_be_read(small_project, tmp_path):
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    try:
        shutil.copytree(small_project.session.folder, folder)
        path = folder / "background" / "background.png"
        path.rename(path.with_name(os.fsdecode(b"b\xe9.png")))
    except OSError:
        pytest.skip("this disk keeps names as text")
    calibration = assemble(FULL, read_session(folder), small_project.results).calibration
    write_calibration(calibration, tmp_path / "c.gplcal")
    provenance = read_calibration(tmp_path / "c.gplcal").provenance
    assert provenance.session == r"caf\udce9"
    assert r"background/b\udce9.png" in provenance.sources
