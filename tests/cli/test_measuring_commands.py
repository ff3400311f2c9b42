"""Commands that measure: objects, profiles and drift."""

import csv
import json

import numpy as np
import pytest
from one_line import refusal

from app.cli.main import MENDABLE, main


@pytest.mark.function("`gelpolight measure --shape auto`")
def test_the_shape_is_detected_automatically(calibration, press, capsys):
    assert main(["measure", str(calibration), str(press), "--shape", "auto"]) == 0
    assert capsys.readouterr().out.splitlines()[0].split() == ["shape", "cylinder"]


@pytest.mark.function("`gelpolight measure`: several images, also when one cannot be measured")
def test_an_image_that_cannot_be_measured_does_not_stop_the_others(
    calibration, session, press, tmp_path, capsys
):
    bare = next((session / "background").iterdir())
    file = tmp_path / "m.json"
    images = (str(bare), str(tmp_path / "none.png"), str(press))
    arguments = ["measure", str(calibration), *images, "--shape", "cylinder", "--json", str(file)]
    assert main(arguments) == MENDABLE
    empty, missing, measured = json.loads(file.read_text())
    assert (empty["image"], missing["image"], measured["image"]) == (
        bare.name,
        "none.png",
        press.name,
    )
    assert "pressed" in empty["error"]
    assert "none.png: " in missing["error"]
    assert measured["diameter_mm"] == pytest.approx(5.0, rel=0.05)
    errors = capsys.readouterr().err.splitlines()
    assert [line for line in errors if str(bare) in line or "none.png" in line] == errors


@pytest.mark.parametrize(("seed", "place"), [(["9", "-9"], "(9, -9)"), (["-9,9"], "(-9, 9)")])
def test_the_object_is_selected_by_a_point_in_both_notations(
    calibration, press, capsys, seed, place
):
    arguments = ("measure", str(calibration), str(press), "--shape", "cylinder", "--at", *seed)
    assert f"no object lies at {place} mm" in refusal(capsys, *arguments)


@pytest.mark.function("`gelpolight profile`: depth along a line as a table")
def test_a_profile_is_written_as_a_table(calibration, press, tmp_path):
    file = tmp_path / "section.csv"
    ends = ["--from", "-6,0.5", "--to", "6", "-0.5", "--width", "0.4"]
    assert main(["profile", str(calibration), str(press), *ends, "-o", str(file)]) == 0
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    ends_mm = [[float(rows[k][name]) for name in ("x_mm", "y_mm")] for k in (0, -1)]
    assert np.allclose(ends_mm, [[-6.0, 0.5], [6.0, -0.5]], atol=1e-6)


@pytest.mark.function("`gelpolight drift`, `drift --zero`: has the sensor changed?")
def test_drift_is_reported_and_the_zeroed_calibration_is_usable(
    calibration, session, tmp_path, capsys
):
    bare = str(next((session / "background").iterdir()))
    figures, new = tmp_path / "drift.json", tmp_path / "zero.gplcal"
    arguments = ["drift", str(calibration), bare, "--json", str(figures), "--zero", str(new)]
    assert main(arguments) == 0
    assert "Change of brightness, red" in capsys.readouterr().out
    drift = json.loads(figures.read_text())
    assert drift["touched"] is False
    assert np.abs(drift["brightness_percent"]).max() < 0.5
    assert main(["inspect", str(new)]) == 0


@pytest.mark.parametrize("tolerance", [["5", "nan"], ["0", "5"]])
def test_a_tolerance_that_is_not_above_zero_is_refused_in_one_line(press, tolerance, capsys):
    arguments = ["--shape", "ball", "--tolerance", *tolerance]
    assert "--tolerance" in refusal(capsys, "measure", "none.gplcal", str(press), *arguments)
