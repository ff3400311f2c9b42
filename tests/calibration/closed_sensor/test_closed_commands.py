"""The commands with a closed sensor: its session is recognised, and every command goes on."""

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from report_pdf import report_data
from scipy.interpolate import RegularGridInterpolator

from app.cli.main import MENDABLE, main
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.closed_sensor_recipe import BALLS
from gelpolight_core.output.report.calibration_report import calibration_report
from gelpolight_core.reconstruction.height_map import normals_from_slopes


@pytest.fixture(scope="module")
def calibration(closed_run, tmp_path_factory):
    """Return the file of a closed sensor's calibration."""
    path = tmp_path_factory.mktemp("closed-file") / "closed.gplcal"
    write_calibration(closed_run.calibration, path)
    return path


@pytest.mark.function("Calibrate a closed session by command, recognised by itself")
def test_a_closed_session_becomes_a_calibration_by_itself(closed_folder, tmp_path, capsys):
    path, report = tmp_path / "closed.gplcal", tmp_path / "closed.json"
    assert main(["calibrate", str(closed_folder), "-o", str(path), "--json", str(report)]) == 0
    output = capsys.readouterr().out
    assert "in-place" in output and "optics" in output and "temperature" in output
    content = json.loads(report.read_text())
    assert content["model"] == "in-place"
    assert len(content["balls"]) >= 8
    assert content["error_by_balls"][-1][1] < content["error_by_balls"][0][1]
    assert main(["inspect", str(path)]) == 0
    assert "mm/px" in capsys.readouterr().out


@pytest.mark.function("Measure an image of a closed sensor")
def test_images_are_reconstructed_measured_and_timed(calibration, closed_folder, tmp_path):
    image = sorted((closed_folder / "balls").iterdir())[0]
    out = tmp_path / "out"
    assert main(["reconstruct", str(calibration), str(image), "-o", str(out), "--uncertainty"]) == 0
    with np.load(out / f"{image.stem}.npz") as arrays:
        assert {"depth_mm", "normals", "x_mm", "y_mm", "flags", "pitch_mm"} <= set(arrays)
        assert (arrays["depth_sd_mm"] > 0.0).all()
        assert arrays["depth_mm"].shape == (arrays["y_mm"].size, arrays["x_mm"].size)
    measured = tmp_path / "ball.json"
    command = ["measure", str(calibration), str(image), "--shape", "ball"]
    assert main([*command, "--json", str(measured)]) == 0
    found = json.loads(measured.read_text())
    assert found["diameter_mm"] > 0.0 and found["sd"]["diameter_mm"] > 0.0
    timed = tmp_path / "time.json"
    command = ["benchmark", str(calibration), str(image), "--repeats", "2"]
    assert main([*command, "--json", str(timed)]) == 0
    assert json.loads(timed.read_text())["model"] == "in-place"


@pytest.mark.function("Read beside a measurement which change of the light was corrected")
def test_a_change_of_the_light_that_is_corrected_is_said(
    calibration, closed_folder, tmp_path, capsys
):
    image, darker = sorted((closed_folder / "balls").iterdir())[0], tmp_path / "darker.png"
    pixels = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
    assert cv2.imwrite(str(darker), np.rint(0.8 * pixels).astype(np.uint8))
    assert main(["measure", str(calibration), str(darker), "--shape", "ball"]) == 0
    output = capsys.readouterr().out
    assert "verdict      ok" in output
    assert "darker than at calibration" in output and "corrected for this" in output


@pytest.mark.function("Use a new gel with a new background only")
def test_a_new_gel_needs_a_background_only(calibration, closed_folder, tmp_path):
    """Some balls correct it further."""
    background = next((closed_folder / "background").iterdir())
    for number, given in enumerate((["--background", background], ["--session", closed_folder])):
        new = tmp_path / f"{number}.gplcal"
        assert main(["refresh", str(calibration), *map(str, given), "-o", str(new)]) == 0
        assert read_calibration(new).model == "in-place"


def test_one_message_lists_all_that_an_open_calibration_lacks(small_session, tmp_path, capsys):
    folder = tmp_path / "session"
    shutil.copytree(small_session, folder)
    for stage in ("checkerboard", "top_pose", "mirror", "whiteboard"):
        shutil.rmtree(folder / stage)
    assert main(["calibrate", str(folder), "-o", str(tmp_path / "c.gplcal")]) == MENDABLE
    output = capsys.readouterr().err
    assert "no images of: checkerboard, top_pose, mirror, whiteboard" in output
    assert "must be open for: checkerboard, top_pose, mirror, whiteboard" in output
    assert "[in_place] mm_per_px" in output
    (folder / "session.toml").write_text(
        'format = "gelpolight-session"\nversion = 1\n[sensor]\nserial = "x"\n'
    )
    assert main(["calibrate", str(folder), "-o", str(tmp_path / "c.gplcal")]) == MENDABLE
    output = capsys.readouterr().err
    assert "[checkerboard], [balls]" in output and "in place" in output


def test_objects_with_walls_are_within_what_is_stated_though_balls_have_none(
    calibration, small_session, tmp_path
):
    image = small_session / "presses" / "cylinder_s5_d100.png"
    measured = tmp_path / "cylinder.json"
    command = ["measure", str(calibration), str(image), "--shape", "cylinder"]
    assert main([*command, "--json", str(measured)]) == 0
    found = json.loads(measured.read_text())
    for key, true in (("height_mm", 1.0), ("diameter_mm", 5.0)):
        assert found[key] == pytest.approx(true, rel=0.15)
        assert abs(found[key] - true) < 2.0 * found["sd"][key]


def test_reports_show_presses_and_what_is_not_known(
    calibration, closed_run, closed_session, tmp_path
):
    path = tmp_path / "report.pdf"
    assert main(["report", str(calibration), "-o", str(path)]) == 0
    facts = dict(report_data(path)["facts"])
    assert facts["Not known"] == "optics, refraction, temperature" and "mm/px" in facts["Scale"]
    refused = {"ball_99.png": InputError("No ball", where="ball_99.png", advice="Press one")}
    slopes = closed_run.results[BALLS]
    slopes = replace(slopes, result=replace(slopes.result, refused=refused))
    results = closed_run.results.having(BALLS, slopes)
    report = calibration_report(closed_run.calibration, replace(closed_run, results=results))
    sections = {section.key: section for section in report.sections}
    assert set(sections) == {"result", "scale", "balls", "in_place"}
    assert sections["balls"].listings[0].rows == (("ball_99.png", "No ball. Press one."),)
    shown = [row[0] for row in sections["in_place"].listings[0].rows]
    assert shown == [press.name for press in closed_run.results[BALLS].result.presses]


@pytest.mark.function("Take a closed sensor's normals to a program that looks them up by colour")
def test_the_exported_table_gives_the_normals_of_the_calibration(
    calibration, closed_run, closed_session, tmp_path
):
    path = tmp_path / "normals.npz"
    assert main(["export-normals", str(calibration), "-o", str(path)]) == 0
    with np.load(path) as stored:
        table = {name: stored[name] for name in stored.files}
    image = closed_session.images("balls")[0].rgb
    model = closed_run.calibration.data.in_place
    blur = float(table["smoothing_nodes"])
    light, flat = (cv2.GaussianBlur(part, (0, 0), blur) for part in (image, table["background"]))
    change = (light - flat) / (flat + table["offset"])
    axes = [table[name] for name in ("y_mm", "x_mm", "red", "green", "blue")]
    look_up = RegularGridInterpolator(axes, table["normal"])
    ball = closed_run.results[BALLS].result.presses[0].ball
    rows, columns = np.indices(change.shape[:2])
    inside = np.hypot(columns - ball.x, rows - ball.y) < 0.9 * ball.contact
    places = model.grid.y_mm[rows[inside]], model.grid.x_mm[columns[inside]]
    found = look_up(np.column_stack([*places, change[inside]]))
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    slopes = ball.slopes(columns[inside] - ball.x, rows[inside] - ball.y)
    true = np.column_stack([-slopes, -np.ones(len(slopes))])
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    degrees = np.degrees(np.arccos(np.clip((found * true).sum(axis=1), -1.0, 1.0)))
    assert degrees.mean() < 2.0
    own = normals_from_slopes(*model.slopes(change))[inside]
    off = np.degrees(np.arccos(np.clip((found * own).sum(axis=1), -1.0, 1.0)))
    assert np.quantile(off, 0.99) < 0.5
    assert 0.0 < table["seen"].mean() < 1.0


def test_an_open_sensor_has_no_table_of_normals(small_calibration, tmp_path, capsys):
    path = tmp_path / "open.gplcal"
    write_calibration(small_calibration, path)
    command = ["export-normals", str(path), "-o", str(tmp_path / "table.npz")]
    assert main(command) == MENDABLE
    assert "another kind of sensor" in capsys.readouterr().err
