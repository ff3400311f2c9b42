"""The commands as a technician types them, and their results."""

import json
import re
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
import scene
from one_line import refusal

import gelpolight_core as gp
from app.cli import calibrate
from app.cli.main import main
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.annotations import write_reason
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.calibration.recipes import PAPER


@pytest.mark.function("`gelpolight inspect`: provenance and quality table")
def test_inspect_shows_provenance_and_quality(calibration, capsys):
    assert main(["inspect", str(calibration)]) == 0
    shown = capsys.readouterr().out
    for word in ("Calibration", "Verdict", "Created", "Focal length", "top_pose", "reflectance"):
        assert word in shown


def test_the_command_gives_the_calibration_of_the_wizard(calibration, small_project):
    step_by_step = small_project.finish(PAPER).calibration.data
    at_once = read_calibration(calibration).data
    for name in ("radiance", "factors", "led_positions_mm"):
        np.testing.assert_array_equal(getattr(at_once, name), getattr(step_by_step, name))


@pytest.mark.function("`gelpolight reconstruct --format`: a depth map in every format")
def test_a_press_becomes_a_depth_map_in_every_format(calibration, press, tmp_path, capsys):
    arguments = ["reconstruct", str(calibration), str(press), "-o", str(tmp_path / "out")]
    formats = "npz,tif,ply,stl,gwy,x3p,png"
    assert main([*arguments, "--format", formats, "--model", "paper", "--explain"]) == 0
    assert "integration" in capsys.readouterr().out
    names = sorted(p.name for p in (tmp_path / "out").iterdir())
    endings = ("depth.png", "gwy", "npz", "ply", "stl", "tif", "x3p")
    assert names == [f"{press.stem}.{e}" for e in endings]
    depth_png = cv2.imread(str(tmp_path / "out" / names[0]), cv2.IMREAD_UNCHANGED)
    assert depth_png.dtype == np.uint16
    with np.load(tmp_path / "out" / f"{press.stem}.npz", allow_pickle=False) as data:
        depth, pitch = data["depth_mm"], float(data["pitch_mm"])
        assert depth.dtype == np.float32
        assert data["flags"].dtype == np.uint8
        assert data["x_mm"].shape == (depth.shape[1],)
        assert np.diff(data["x_mm"]) == pytest.approx(pitch)
        assert {"calibration_id", "flag_names", "normals", "y_mm"} <= set(data)
    assert np.nanmax(depth) == pytest.approx(1.0, rel=0.08)


@pytest.mark.function("`gelpolight measure --shape --truth`: a press against its truth")
def test_a_press_is_measured_against_its_truth(session, calibration, press, tmp_path):
    result = tmp_path / "m.json"
    truth = session / "presses" / "truth.csv"
    arguments = ["measure", str(calibration), str(press), "--shape", "cylinder"]
    assert main([*arguments, "--truth", str(truth), "--json", str(result)]) == 0
    m = json.loads(result.read_text())
    assert {"shape", "diameter_mm", "height_mm", "centre_mm", "yaw_deg", "drape_decay_mm"} <= set(m)
    assert {"sd", "truth", "error_percent", "verdict", "reason"} <= set(m)
    # The paper's model gives neither.
    assert m["noise_sd"] is None
    assert m["calibration_sd"] is None
    assert m["diameter_mm"] == pytest.approx(5.0, rel=0.06)
    assert m["height_mm"] == pytest.approx(1.0, rel=0.06)


def test_a_calibration_that_failed_is_reported_by_every_command(
    small_run, session, calibration, press, tmp_path, capsys, monkeypatch
):
    failed = scene.failed(read_calibration(calibration))
    file, result = tmp_path / "failed.gplcal", tmp_path / "m.json"
    write_calibration(failed, file)
    write_reason("for teaching", file)
    commands = (
        ["measure", str(file), str(press), "--shape", "cylinder", "--json", str(result)],
        ["reconstruct", str(file), str(press), "-o", str(tmp_path)],
    )
    for command in commands:
        assert main(command) == 0
        assert "FAIL: the calibration failed its quality check" in capsys.readouterr().err
    m = json.loads(result.read_text())
    assert m["verdict"] == "doubtful"
    assert m["reason"].startswith("the calibration failed its quality check (Half a pixel")
    height_map = gp.read_height_map(tmp_path / f"{press.stem}.npz")
    # A file does not say by which effort its map was made, so that its deviations are larger.
    assert (
        gp.measure(height_map, shape="cylinder").reason.split("; ")[0] == m["reason"].split("; ")[0]
    )
    assert main(["inspect", str(file)]) == 0
    assert "for teaching" in capsys.readouterr().out

    run = replace(small_run, calibration=failed)
    monkeypatch.setattr(calibrate, "run_calibration", lambda *_given, **_named: run)
    out = ["-o", str(tmp_path / "again.gplcal"), "--json", str(result)]
    assert main(["calibrate", str(session), *out]) == 0
    assert "FAIL: the calibration failed" in capsys.readouterr().err
    assert json.loads(result.read_text())["verdict"] == "fail"
    assert read_calibration(tmp_path / "again.gplcal").verdict is Verdict.FAIL


@pytest.mark.function("`gelpolight reconstruct --uncertainty`: standard deviations")
def test_the_full_model_gives_its_uncertainty(small_session, small_calibration, tmp_path, capsys):
    file, name = tmp_path / "full.gplcal", "cylinder_s5_d100"
    write_calibration(small_calibration, file)
    image = str(small_session / "presses" / f"{name}.png")
    result = tmp_path / "m.json"
    assert main(["measure", str(file), image, "--shape", "cylinder", "--json", str(result)]) == 0
    assert re.search(r"diameter +\S+ ± \S+ mm .*calibration \S+ µm", capsys.readouterr().out)
    m = json.loads(result.read_text())
    assert set(m["noise_sd"]) == set(m["calibration_sd"]) == set(m["sd"])
    for key in ("height_mm", "diameter_mm"):
        assert m["sd"][key] >= np.hypot(m["noise_sd"][key], m["calibration_sd"][key]) * 0.999
    assert main(["reconstruct", str(file), image, "-o", str(tmp_path), "--uncertainty"]) == 0
    with np.load(tmp_path / f"{name}.npz", allow_pickle=False) as data:
        for key in ("depth_sd_mm", "slope_sd", "depth_model_sd_mm", "slope_model_sd"):
            assert data[key].shape == data["depth_mm"].shape
            assert data[key].dtype == np.float32
        scale_sd = small_calibration.data.full.scale_sd.depth
        assert float(data["depth_scale_sd"]) >= scale_sd  # other terms come on top


@pytest.mark.function("`gelpolight evaluate`: each press of a folder")
def test_the_evaluation_measures_every_press_of_the_folder(session, calibration, press, tmp_path):
    presses = tmp_path / "presses"
    presses.mkdir()
    for name in (press.name, "cuboid_s4_d100.png"):
        shutil.copy(session / "presses" / name, presses)
    rows = (session / "presses" / "truth.csv").read_text().splitlines()
    kept = [rows[0], *(r for r in rows if r.startswith(("cylinder_s5_d100", "cuboid_s4_d100")))]
    (presses / "truth.csv").write_text("\n".join(kept) + "\n")
    assert main(["evaluate", str(calibration), str(presses), "-o", str(tmp_path / "e")]) == 0
    endings = ("csv", "json", "pdf", "png", "txt")
    assert {f"evaluation.{ending}" for ending in endings} == {
        p.name for p in (tmp_path / "e").iterdir()
    }
    assert cv2.imread(str(tmp_path / "e" / "evaluation.png")) is not None


@pytest.mark.function("`gelpolight benchmark`: where the time of a frame goes")
def test_the_benchmark_lists_the_time_of_each_step(calibration, press, tmp_path):
    result = tmp_path / "b.json"
    arguments = ["benchmark", str(calibration), str(press), "--json", str(result)]
    assert main([*arguments, "--repeats", "2"]) == 0
    timing = json.loads(result.read_text())
    assert {"total_ms", "copy_floor_ms", "steps", "threads", "model", "plan"} <= set(timing)
    assert {"name", "median_ms", "p95_ms", "bytes"} <= set(timing["steps"][0])
    done = [step["step"] for step in timing["plan"] if step["done"]]
    assert done == [step["name"] for step in timing["steps"]]


@pytest.mark.function("`gelpolight design`: a design is checked from its file")
def test_a_design_is_checked_from_its_file(tmp_path, capsys):
    (tmp_path / "d.toml").write_text("")
    assert main(["design", str(tmp_path / "d.toml")]) == 0
    shown = capsys.readouterr().out
    assert "design" in shown
    assert "pixel (" in shown
    (tmp_path / "bad.toml").write_text("nonsense = 1\n")
    assert "nonsense" in refusal(capsys, "design", str(tmp_path / "bad.toml"))
