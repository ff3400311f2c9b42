"""The measuring tools by command: what is drawn on the screen, repeated without it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from one_line import refusal

from app.command_line.main import main
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.measurement.tools import result_as_dict, tool_from_dict
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_picture


def test_a_tool_by_command_agrees_with_the_core_to_the_last_bit_and_is_repeated(
    calibration: Path, press: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, again = tmp_path / "step.json", tmp_path / "again.json"
    arguments = ["measure", str(calibration), str(press)]
    places = ["--at", "-6", "-6", "0,0", "--size", "1", "1", "--yaw", "10"]
    assert main([*arguments, "--tool", "step-height", *places, "--json", str(file)]) == 0
    assert "step height" in capsys.readouterr().out
    content = json.loads(file.read_text())
    (stored,) = content["results"]
    made = read_calibration(calibration)
    picture = read_picture(press, response=made.response)
    heightmap = Reconstructor(made).depth(picture.rgb, name=press.name, uncertainty=True)
    plain = {k: v for k, v in stored.items() if k not in ("figures", "verdict", "reason")}
    assert result_as_dict(tool_from_dict(plain).apply(heightmap)) == stored
    assert (content["image"], content["calibration_id"]) == (press.name, made.identity)
    assert main([*arguments, "--tools", str(file), "--json", str(again)]) == 0
    assert json.loads(again.read_text()) == content


def test_the_shape_is_found_by_itself(
    calibration: Path, press: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["measure", str(calibration), str(press), "--shape", "auto"]) == 0
    assert capsys.readouterr().out.splitlines()[0].split() == ["shape", "cylinder"]


@pytest.mark.parametrize(
    ("seed", "place"),
    [(["9", "-9"], "(9, -9)"), (["-9,9"], "(-9, 9)")],
)
def test_the_object_is_named_by_a_place_in_either_manner(
    calibration: Path,
    press: Path,
    capsys: pytest.CaptureFixture[str],
    seed: list[str],
    place: str,
) -> None:
    arguments = ("measure", "--shape", "cylinder", "--seed", *seed, str(calibration), str(press))
    assert f"no object lies at the seed point {place} mm" in refusal(capsys, *arguments)


def test_a_place_on_an_object_is_not_ignored_beside_stored_tools(
    press: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = tmp_path / "tools.json"
    stored.write_text('[{"tool": "ball"}]')
    arguments = ("measure", "none.gplcal", str(press), "--tools", str(stored), "--seed", "1", "2")
    assert "--seed: it does not go with" in refusal(capsys, *arguments)


def test_a_profile_is_written_as_a_table(calibration: Path, press: Path, tmp_path: Path) -> None:
    file = tmp_path / "section.csv"
    ends = ["--from", "-6,0.5", "--to", "6", "-0.5", "--width", "0.4"]
    assert main(["profile", str(calibration), str(press), *ends, "-o", str(file)]) == 0
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    ends_mm = [[float(rows[k][name]) for name in ("x_mm", "y_mm")] for k in (0, -1)]
    assert np.allclose(ends_mm, [[-6.0, 0.5], [6.0, -0.5]], atol=1e-6)


def test_drift_is_told_and_the_zeroed_calibration_is_usable(
    calibration: Path, session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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
    ("arguments", "said"),
    [
        (["--tool", "distance", "--at", "1", "2"], "1 places are given"),
        (["--tool", "distance", "--at", "1", "2", "3"], "3 numbers"),
        (["--tool", "rectangle", "--at", "1", "2"], "--size"),
        (["--tool", "circle", "--at", "1", "2", "3", "4", "5", "7", "--yaw", "3"], "--yaw"),
        (["--tool", "profile-step", "--at", "1", "2", "3", "4", "--range", "1", "2"], "takes 4"),
        (["--tools", "nowhere.json"], "cannot be read as JSON"),
        (["--shape", "ball", "--at", "1", "2"], "does not go with --shape"),
        (["--tool", "ball", "--truth", "truth.csv"], "--truth"),
        (["--tool", "ball", "--seed", "1", "2"], "--seed: it does not go with"),
    ],
)
def test_a_tool_that_is_not_described_is_refused_in_one_line(
    press: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refusal(capsys, "measure", "none.gplcal", str(press), *arguments)
