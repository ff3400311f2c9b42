"""The measuring tools on the command line: the same results as on the screen."""

import csv
import json

import numpy as np
import pytest
from one_line import refusal

from app.command_line.main import MENDABLE, main
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.measurement.tools import result_as_dict, tool_from_dict
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import read_image


def test_a_tool_by_command_agrees_with_the_core_to_the_last_bit_and_is_repeated(
    calibration, press, tmp_path, capsys
):
    file, again = tmp_path / "step.json", tmp_path / "again.json"
    arguments = ["measure", str(calibration), str(press)]
    places = ["--at", "-6", "-6", "0,0", "--size", "1", "1", "10"]
    assert main([*arguments, "--tool", "step-height", *places, "--json", str(file)]) == 0
    assert "step height" in capsys.readouterr().out
    content = json.loads(file.read_text())
    (stored,) = content["results"]
    made = read_calibration(calibration)
    image = read_image(press, response=made.response)
    heightmap = Reconstructor(made).depth(image.rgb, name=press.name, uncertainty=True)
    plain = {k: v for k, v in stored.items() if k not in ("figures", "verdict", "reason")}
    assert result_as_dict(tool_from_dict(plain).apply(heightmap)) == stored
    assert (content["image"], content["calibration_id"]) == (press.name, made.identity)
    assert main([*arguments, "--tool", str(file), "--json", str(again)]) == 0
    assert json.loads(again.read_text()) == content


def test_the_shape_is_detected_automatically(calibration, press, capsys):
    assert main(["measure", str(calibration), str(press), "--shape", "auto"]) == 0
    assert capsys.readouterr().out.splitlines()[0].split() == ["shape", "cylinder"]


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


def test_tools_are_applied_to_several_images(calibration, press, tmp_path):
    file = tmp_path / "m.json"
    arguments = ["measure", str(calibration), str(press), str(press), "--json", str(file)]
    assert main([*arguments, "--tool", "distance", "--at", "-1", "2", "2", "2"]) == 0
    first, second = json.loads(file.read_text())
    assert first == second
    assert first["image"] == press.name
    assert [result["tool"] for result in first["results"]] == ["distance"]


@pytest.mark.parametrize(("seed", "place"), [(["9", "-9"], "(9, -9)"), (["-9,9"], "(-9, 9)")])
def test_the_object_is_selected_by_a_point_in_both_notations(
    calibration, press, capsys, seed, place
):
    arguments = ("measure", str(calibration), str(press), "--shape", "cylinder", "--at", *seed)
    assert f"no object lies at {place} mm" in refusal(capsys, *arguments)


def test_a_profile_is_written_as_a_table(calibration, press, tmp_path):
    file = tmp_path / "section.csv"
    ends = ["--from", "-6,0.5", "--to", "6", "-0.5", "--width", "0.4"]
    assert main(["profile", str(calibration), str(press), *ends, "-o", str(file)]) == 0
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    ends_mm = [[float(rows[k][name]) for name in ("x_mm", "y_mm")] for k in (0, -1)]
    assert np.allclose(ends_mm, [[-6.0, 0.5], [6.0, -0.5]], atol=1e-6)


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


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["--tool", "distance", "--at", "1", "2", "3"], "Number of values: 3"),
        (["--tool", "distance", "--at", "1", "2", "3", "4", "5", "6"], "points: 3"),
        (["--tool", "rectangle", "--at", "1", "2"], "--size"),
        (["--tool", "edge-radius", "--at", "1,2", "3,4", "--set", "level_mm=1"], "level_mm"),
        (
            ["--tool", "edge-radius", "--at", "1,2", "3,4", "--set", "width_mm=wide"],
            "width_mm: 'wide' is not a number",
        ),
        (["--tool", "circle", "--at", "1", "2", "3", "4", "5", "7", "--size", "3"], "--size"),
        (["--tool", "profile-step", "--at", "1,2", "3,4", "--set", "first_mm=1,2"], "second_mm"),
        (["--tool", "nowhere.json"], "nor a JSON file"),
        (["--shape", "ball", "--size", "1", "2"], "cannot be used with --shape"),
        (["--tool", "ball", "--truth", "truth.csv"], "--truth"),
        (["--shape", "ball", "--tolerance", "5", "nan"], "--tolerance"),
    ],
)
def test_a_tool_that_is_not_described_is_refused_in_one_line(press, arguments, output, capsys):
    assert output in refusal(capsys, "measure", "none.gplcal", str(press), *arguments)
