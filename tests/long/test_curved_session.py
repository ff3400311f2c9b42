"""A sensor with a curved membrane, from its session to depths, by the virtual sensor."""

import csv
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from gelpolight_core._api import read_height_map, read_image, write_height_map
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND, RADIANCE
from gelpolight_core.calibration.project import run_calibration, run_stage
from gelpolight_core.calibration.recipes import FULL, recipe_of
from gelpolight_core.calibration.reflectance_scatter import gather_scatter
from gelpolight_core.measurement.object_measurement import measure_object
from gelpolight_core.output.report.calibration_report import calibration_report
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_session


@pytest.fixture(scope="module")
def curved_run(curved_session):
    """Return its calibration with all results; not to be changed."""
    return run_calibration(read_session(curved_session))


@pytest.fixture(scope="module")
def curved_calibration(curved_run):
    """Return its calibration; not to be changed."""
    return curved_run.calibration


def a_press(folder: Path) -> Path:
    return sorted((folder / "presses").glob("cylinder*.png"))[0]


@pytest.fixture(scope="module")
def pressed(curved_session, curved_calibration):
    path = a_press(curved_session)
    return Reconstructor(curved_calibration).depth(read_image(path), name=path.name)


def as_stated(session: Path, folder: Path, text: str) -> Path:
    """Return a copy of the session with another session.toml, without presses."""
    ignored = shutil.ignore_patterns("truth", "presses")
    copied = Path(shutil.copytree(session, folder / "session", ignore=ignored))
    (copied / "session.toml").write_text(text)
    return copied


def test_its_route_has_no_white_board_and_the_papers_model_is_refused(curved_session):
    session = read_session(curved_session)
    assert not (curved_session / "whiteboard").exists()
    assert recipe_of(session, "full") is FULL
    assert "radiance" not in [stage.key for stage in FULL.of(session)]
    with pytest.raises(InputError, match="curved"):
        recipe_of(session, "paper")
    with pytest.raises(InputError, match="in_place"):
        recipe_of(session, "in-place")


@pytest.mark.function("Calibrate a sensor with a curved membrane, and get depth and surface")
def test_its_height_is_confirmed_and_depths_are_the_truth(
    curved_session, curved_calibration, pressed
):
    figures = {f.key: f for table in curved_calibration.quality.values() for f in table.figures}
    assert figures["membrane_height_mm"].verdict is Verdict.PASS
    assert figures["boundary_diameter_percent"].verdict is Verdict.PASS
    truth = np.load(curved_session / "truth" / f"{a_press(curved_session).stem}.npz")
    x, y = np.meshgrid(pressed.x_mm, pressed.y_mm)
    place = [(y - truth["y0_mm"]) / truth["pitch_mm"], (x - truth["x0_mm"]) / truth["pitch_mm"]]
    expected = map_coordinates(truth["depth_mm"], place, order=1, cval=0.0)
    error = (pressed.depth_mm - expected)[np.hypot(x, y) < 11.0]
    face = map_coordinates(truth["contact"].astype(float), place, order=1) > 0.99
    # Nodes of 0.1 mm; a flat sensor of this size is off by up to 6 %.
    assert np.median(pressed.depth_mm[face] / expected[face]) == pytest.approx(1.0, abs=0.04)
    assert np.sqrt(np.mean(error**2)) < 0.015
    # Where nothing is pressed, the surface is the cap.
    corner = np.unravel_index(np.argmin(np.hypot(x + 6.0, y + 6.0)), x.shape)
    cap = curved_calibration.open_sensor.surface
    assert pressed.height_mm[corner] == pytest.approx(
        float(cap.height(np.array([x[corner], y[corner]]))), abs=0.005
    )
    np.testing.assert_allclose(
        pressed.normals[corner], cap.normals(np.array([x[corner], y[corner]])), atol=0.01
    )


def test_a_flat_face_is_measured_as_a_plane_in_space(curved_session, pressed):
    found = measure_object(pressed, shape="cylinder")
    with (curved_session / "presses" / "truth.csv").open() as file:
        (stated,) = (row for row in csv.DictReader(file) if row["file"] == pressed.source)
    assert found.diameter_mm == pytest.approx(float(stated["diameter_mm"]), rel=0.02)
    assert found.height_mm == pytest.approx(float(stated["height_mm"]), rel=0.02)


def test_files_keep_the_shape(tmp_path, curved_calibration, pressed):
    write_calibration(curved_calibration, tmp_path / "k.gplcal")
    kept = read_calibration(tmp_path / "k.gplcal")
    assert kept.open_sensor.surface == curved_calibration.open_sensor.surface
    (path,) = write_height_map(pressed, tmp_path, formats=("npz",))
    again = read_height_map(path)
    assert again.at_rest == pressed.at_rest
    np.testing.assert_array_equal(np.load(path)["height_mm"], pressed.height_mm)


def test_a_session_without_its_membrane_lacks_the_white_board(tmp_path, curved_session):
    text = (curved_session / "session.toml").read_text()
    folder = as_stated(curved_session, tmp_path, re.sub(r"\[membrane\]\n(?:\w.*\n)*", "", text))
    with pytest.raises(InputError, match="whiteboard") as refused:
        run_calibration(read_session(folder))
    assert "[membrane]" in str(refused.value)


def test_a_white_board_of_a_flat_membrane_before_does_not_count(
    tmp_path, curved_session, curved_run
):
    folder = tmp_path / "session"
    shutil.copytree(curved_session, folder, ignore=shutil.ignore_patterns("truth", "presses"))
    session, results = read_session(folder), curved_run.results
    other = results.having(RADIANCE, replace(results[BACKGROUND].radiance, usable=np.zeros((1, 1))))
    shutil.copytree(folder / "background", folder / "whiteboard")
    again = run_stage(FULL, BACKGROUND, session, other)[BACKGROUND]
    assert again.table.surface.shape == "spherical_cap"
    assert again.radiance.usable.shape == again.table.valid.shape
    np.testing.assert_array_equal(again.light, results[BACKGROUND].light)


def test_its_report_and_the_scatter_of_its_curves_are_made(curved_run):
    titles = [
        section.title for section in calibration_report(curved_run.calibration, curved_run).sections
    ]
    assert "Light intensity" not in titles
    assert len(gather_scatter(curved_run).names) == 6


def test_a_cap_that_is_stated_flat_fails_with_its_height(tmp_path, curved_session):
    text = (curved_session / "session.toml").read_text()
    flat = text.replace("apex_height_mm = 2.0", "apex_height_mm = 0.0")
    run = run_calibration(read_session(as_stated(curved_session, tmp_path, flat)))
    found = run.calibration.quality["joint"]["membrane_height_mm"]
    assert found.verdict is Verdict.FAIL
    assert found.value > 1.0
