"""The ablation as its reader meets it: each term's worth and cost on a session with truth."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.command_line.main import MENDABLE, main
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.calibration.refinement import bare_calibration, refine_with
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.terms import CalibrationTerms
from gelpolight_core.experiments import ablation
from gelpolight_core.experiments.ablation import VARIANTS
from gelpolight_core.session.session import SensorData, read_session

PRESSES = ("cylinder_s5_d100.png", "cuboid_s4_d100.png")
BALLS = (0, 2, 4, 5)


@pytest.fixture(scope="module")
def small(virtual_session: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the virtual session with four of its balls and two of its presses."""
    folder = tmp_path_factory.mktemp("ablation") / "small"
    for stage in ("checkerboard", "top_pose", "mirror", "whiteboard", "background", "truth"):
        shutil.copytree(virtual_session / stage, folder / stage)
    for stage, names in (("presses", PRESSES), ("balls", [f"ball_{n:02d}.png" for n in BALLS])):
        (folder / stage).mkdir()
        for name in names:
            shutil.copy(virtual_session / stage / name, folder / stage)
    described = (virtual_session / "session.toml").read_text().splitlines()
    kept = [f'"ball_{n:02d}.png"' for n in BALLS]
    lines = [x for x in described if not x.startswith('"ball_') or x.split(" ")[0] in kept]
    (folder / "session.toml").write_text("\n".join(lines))
    rows = (virtual_session / "presses" / "truth.csv").read_text().splitlines()
    shown = [row for row in rows if row.startswith(("file", *PRESSES))]
    (folder / "presses" / "truth.csv").write_text("\n".join(shown))
    return folder


def _in_one_plane_without_curves(
    sensor: SensorData, results: StageResults, *, terms: CalibrationTerms
) -> StageResults:
    """Refine; without reflectance curves, the refinement ends at LEDs that no one can use."""
    refined = refine_with(sensor, results, terms=terms)
    assert refined.full is not None
    if terms.curves:
        return refined
    beside = np.array([[2.0, 0.0, -10.0], [4.0, 0.0, -10.0], [6.0, 0.0, -10.0]])
    return replace(refined, full=replace(refined.full, led_positions_mm=beside))


def test_the_table_says_what_each_term_is_worth(
    small: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ablation, "refine_with", _in_one_plane_without_curves)
    out = tmp_path / "out"
    terms = "near_light_0,true_positions,gloss,paper"
    asked = f"{terms},curves"
    assert main(["ablation", str(small), "-o", str(out), "--terms", asked, "--repeats", "1"]) == 0
    captured = capsys.readouterr()
    assert "light computed for depth 0 only" in captured.out
    assert "%" in captured.err  # progress
    content = json.loads((out / "ablation.json").read_text())
    rows = content["rows"]
    assert [item["left_out"] for item in content["refused"]] == ["curves"]
    by_term = {row["left_out"]: row for row in rows}
    assert list(by_term) == ["all", *terms.split(",")]
    whole = by_term["all"]
    assert whole["worth_rms_um"] == 0.0 and whole["cost_ms"] == 0.0
    assert whole["presses"] == len(PRESSES)
    for name in ("near_light_0", "true_positions", "paper"):
        assert by_term[name]["worth_rms_um"] > 5.0
        assert by_term[name]["rms_um"] == pytest.approx(
            whole["rms_um"] + by_term[name]["worth_rms_um"]
        )
    assert np.isfinite([by_term[n]["cost_ms"] for n in ("near_light_0", "true_positions")]).all()
    assert by_term["gloss"]["cost_calibration_s"] is not None
    assert by_term["true_positions"]["cost_calibration_s"] is None
    with (out / "ablation.csv").open() as stream:
        table = list(csv.DictReader(stream))
    assert [float(row["rms_um"]) for row in table] == [row["rms_um"] for row in rows]
    text = (out / "ablation.md").read_text()
    assert text.count("\n| ") == len(rows) + 1
    assert f"{whole['rms_um']:.1f}" in text


def test_a_calibration_with_all_terms_is_the_sessions_own(
    virtual_session: Path, virtual_run: CalibrationRun, virtual_results: StageResults
) -> None:
    session, results = read_session(virtual_session), virtual_results
    whole = virtual_run.calibration
    again = bare_calibration(session, refine_with(session.sensor, results))
    assert again.identity == whole.identity
    mixed = bare_calibration(
        session, refine_with(session.sensor, results, terms=CalibrationTerms(crosstalk=False))
    )
    np.testing.assert_array_equal(mixed.crosstalk, np.eye(3))
    assert mixed.full is not None and whole.full is not None
    # 5 % of the neighbours' light is left in.
    more = mixed.full.background / np.maximum(whole.full.background, 0.05)
    inside = whole.table.valid & (whole.full.background > 0.1).all(axis=2)
    assert np.median(more[inside]) == pytest.approx(1.08, abs=0.04)


def test_every_variant_leaves_out_one_thing_and_has_a_name_of_its_own() -> None:
    assert len({v.name for v in VARIANTS}) == len(VARIANTS)
    assert len({(v.terms, v.calibration, v.model) for v in VARIANTS}) == len(VARIANTS)


@pytest.mark.parametrize(
    ("arguments", "summary"),
    [
        (["--terms", "near_light_0,colour"], "colour"),
        (["nowhere"], "session.toml"),
    ],
)
def test_what_cannot_be_done_is_refused_before_the_work(
    tmp_path: Path, arguments: list[str], summary: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ablation", *arguments, "-o", str(tmp_path / "out")]) == MENDABLE
    assert summary in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_height_that_the_truth_does_not_reach_is_refused(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "wrong"
    shutil.copytree(small, folder)
    text = (folder / "presses" / "truth.csv").read_text()
    (folder / "presses" / "truth.csv").write_text(text.replace(",1.0", ",1.4"))
    assert main(["ablation", str(folder), "-o", str(tmp_path / "out")]) == MENDABLE
    assert "plateau" in capsys.readouterr().err
