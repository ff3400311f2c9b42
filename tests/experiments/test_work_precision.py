"""Error against run time as its reader meets it: methods, fronts, orders, gaps."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.command_line import work_precision
from app.command_line.main import MENDABLE, main
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.experiments.integrators import measure_integrators
from gelpolight_core.experiments.methods import Scene, methods
from gelpolight_core.experiments.work_precision import (
    Point,
    measure_scene,
    normal_error_deg,
    observed_order,
    pareto_front,
)
from gelpolight_core.experiments.work_precision_report import point_table
from gelpolight_core.measurement.score import TrueDepth
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.session.session import read_session

POINT = Point("virtual-sensor-1", "a", "A", "term", 1.2, 0.02, 10.0, 12.0, 5.0, 1.0, 1.0, 1.0)


def at(ms: float | None, um: float | None, **others: object) -> Point:
    return replace(POINT, median_ms=ms, p95_ms=ms, rms_um=um, **others)  # type: ignore[arg-type]


def test_the_front_is_what_nothing_beats_in_both_time_and_error() -> None:
    points = [at(10, 5), at(5, 9), at(20, 6), at(5, 8), at(None, None, gap="refused"), at(40, 1)]
    assert [(p.median_ms, p.rms_um) for p in pareto_front(points)] == [(5, 8), (10, 5), (40, 1)]


def test_the_observed_order_is_the_exponent_of_the_pitch() -> None:
    points = [at(1, 3.0 * pitch**2, pitch_mm=pitch) for pitch in (0.1, 0.05, 0.02)]
    assert observed_order(points) == pytest.approx(2.0)
    assert observed_order(points[:1]) is None


def test_a_gap_is_a_line_with_its_reason_and_no_number() -> None:
    gap = at(None, None, normal_deg=None, height_percent=None, size_percent=None, gap="it is bent")
    assert "it is bent" in point_table([gap, at(1, 1)])


def test_integrators_converge_as_their_stencils_say() -> None:
    points = measure_integrators(sides=(60, 120, 240), repeats=1)
    orders = {p.name: p.order for p in points if p.side == 120}
    assert orders["stencil_1"] == pytest.approx(1.0, abs=0.05)
    assert orders["stencil_2"] == pytest.approx(2.0, abs=0.05)
    assert orders["stencil_4_double"] == pytest.approx(4.0, abs=0.1)
    assert orders["weighted"] == pytest.approx(4.0, abs=0.1)
    assert orders["plain"] == pytest.approx(2.0, abs=0.05)


def test_the_error_of_a_normal_is_the_angle_between_slopes() -> None:
    axis = np.linspace(-4.0, 4.0, 161)
    plane = TrueDepth(np.tile(0.5 + 0.1 * axis, (161, 1)), axis, axis)
    grid = MembraneGrid(axis[20:-20:2], axis[20:-20:2], 0.1)
    shape = grid.shape
    right = (np.full(shape, 0.1), np.zeros(shape))
    assert normal_error_deg(right, grid, plane, 3.0) == pytest.approx(0.0, abs=1e-3)
    tilted = (np.full(shape, np.tan(np.arctan(0.1) + np.radians(5.0))), np.zeros(shape))
    assert normal_error_deg(tilted, grid, plane, 3.0) == pytest.approx(5.0, abs=1e-3)


def test_methods_have_names_of_their_own() -> None:
    names = [method.name for method in methods()]
    assert len(set(names)) == len(names)
    assert {"directional", "paper", "full_best", "full_balanced", "full_fast"} <= set(names)


@pytest.fixture(scope="module")
def points(small_session: Path, small_calibration: Calibration) -> tuple[Point, ...]:
    """Return three methods on one press; the directional table has no balls to be made of."""
    scene = Scene(StageResults(), small_calibration, small_calibration)
    chosen = [m for m in methods() if m.name in ("directional", "paper", "full_best")]
    session = read_session(small_session)
    return measure_scene(scene, session, chosen, repeats=2, presses=["cylinder_s5_d100.png"])


def test_methods_are_timed_and_scored_and_what_cannot_be_made_is_a_gap(
    points: tuple[Point, ...],
) -> None:
    directional, paper, full = points
    assert directional.gap and directional.median_ms is None and directional.rms_um is None
    assert paper.rms_um is not None and full.rms_um is not None
    assert full.rms_um < paper.rms_um < 60.0
    assert paper.normal_deg is not None and full.normal_deg is not None
    assert 0.5 < full.normal_deg < paper.normal_deg < 10.0
    for point in (paper, full):
        assert point.p95_ms is not None and point.median_ms is not None
        assert point.p95_ms >= point.median_ms > 0.0
    assert full in pareto_front(points)


def test_the_report_holds_every_method(
    points: tuple[Point, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    named = tuple(replace(point, sensor="virtual-sensor-0.25") for point in points)
    monkeypatch.setattr(work_precision, "measure_session", lambda *_, **__: named)
    out = tmp_path / "out"
    folder = out / "virtual-sensor-0.25"  # as an earlier run has left it
    (folder / "presses").mkdir(parents=True)
    (folder / "truth.json").write_text("{}")
    (folder / "session.toml").write_text("")
    monkeypatch.setattr(work_precision, "read_session", lambda _: None)
    (folder / "presses" / "truth.csv").write_text(
        "file,shape,diameter_mm,side_mm,height_mm\na.png,cylinder,5,,1\n"
    )
    assert main(["work-precision", "-o", str(out), "--scales", "0.25", "--repeats", "1"]) == 0
    assert "observed order" in capsys.readouterr().out
    content = json.loads((out / "work-precision.json").read_text())
    assert [p["method"] for p in content["points"]] == ["directional", "paper", "full_best"]
    assert content["points"][0]["rms_um"] is None and content["points"][0]["gap"]
    assert ["virtual-sensor-0.25", "full_best"] in content["front"]
    with (out / "work-precision.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == len(points)
    assert (out / "work-precision.html").read_text().count("data:image/png") == 3


def test_one_calibration_is_measured_as_it_is(
    small_calibration: Calibration, small_session: Path, tmp_path: Path
) -> None:
    file = tmp_path / "small.gplcal"
    write_calibration(small_calibration, file)
    arguments = ["work-precision", str(small_session), "--calibration", str(file), "--repeats", "1"]
    out = tmp_path / "out"
    assert main([*arguments, "--methods", "paper,directional", "-o", str(out)]) == 0
    points = json.loads((out / "work-precision.json").read_text())["points"]
    paper, directional = points
    assert paper["rms_um"] > 0.0 and paper["median_ms"] > 0.0
    assert directional["gap"] and directional["rms_um"] is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--methods", "paper,magic"], "magic"),
        (["--scales", "0.25,x"], "scales"),
        (["--scales", "100"], "scales"),
        (["nowhere"], "session.toml"),
    ],
)
def test_what_cannot_be_measured_is_refused_before_the_work(
    tmp_path: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["work-precision", *arguments, "-o", str(tmp_path / "out")]) == MENDABLE
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
