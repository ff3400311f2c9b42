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
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.experiments.front.measure import (
    Point,
    fronts,
    measure_scene,
    normal_error_deg,
    observed_order,
    pareto_front,
    recommended,
)
from gelpolight_core.experiments.front.methods import methods
from gelpolight_core.experiments.front.quiet import Machine, Watch
from gelpolight_core.experiments.front.report import point_table
from gelpolight_core.experiments.front.scene import Scene, at_scale, session_presses, smaller
from gelpolight_core.measurement.score import TrueDepth
from gelpolight_core.optics.resampling import MembraneGrid
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session

POINT = Point("A", "a", "A", "effort", 1280, 1.2, 0.02, 10.0, 12.0, 5.0, 1.0, 1.0, 1.0)


def at(ms: float | None, um: float | None, **others: object) -> Point:
    return replace(POINT, median_ms=ms, p95_ms=ms, rms_um=um, **others)  # type: ignore[arg-type]


def test_the_front_is_what_nothing_beats_in_both_time_and_error() -> None:
    points = [at(10, 5), at(5, 9), at(20, 6), at(5, 8), at(None, None, gap="refused"), at(40, 1)]
    assert [(p.median_ms, p.rms_um) for p in pareto_front(points)] == [(5, 8), (10, 5), (40, 1)]


def test_sensors_and_sizes_have_fronts_of_their_own() -> None:
    easy, hard = at(10, 1), at(20, 50, sensor="B")
    small = at(2, 9, width=320)
    assert set(fronts([easy, hard, small])) == {easy, hard, small}


def test_the_recommended_method_keeps_the_rate_or_the_error() -> None:
    points = [at(5, 9, method="fast"), at(40, 2, method="best"), at(None, None, gap="refused")]
    assert recommended(points).method == "best"  # type: ignore[union-attr]
    assert recommended(points, rate_hz=30).method == "fast"  # type: ignore[union-attr]
    assert recommended(points, rms_um=10).method == "fast"  # type: ignore[union-attr]
    assert recommended(points, rms_um=5).method == "best"  # type: ignore[union-attr]
    assert recommended(points, rate_hz=30, rms_um=5) is None


def test_the_observed_order_needs_three_sizes() -> None:
    points = [at(1, 3.0 * pitch**2, pitch_mm=pitch) for pitch in (0.1, 0.05, 0.02)]
    found = observed_order(points)
    assert found is not None and found.value == pytest.approx(2.0)
    assert observed_order(points[:2]) is None


def test_a_gap_is_a_line_with_its_reason_and_no_number() -> None:
    gap = at(None, None, normal_deg=None, height_percent=None, size_percent=None, gap="it is bent")
    assert "it is bent" in point_table([gap, at(1, 1)])


def test_the_watch_counts_what_this_program_does_not_use() -> None:
    machine = Watch(0.0).result()
    assert machine.processors >= 1
    assert machine.others_percent is None or machine.others_percent >= 0.0
    busy = Machine(2, "system", "3", 0.0, 80.0, ("other 80 %",))
    assert not busy.quiet and "with each other only" in busy.text
    assert replace(busy, others_percent=3.0).quiet


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
    assert {"paper", "full_best", "full_balanced", "full_fast"} <= set(names)
    assert {"table", "polynomial_wrong", "network"} <= set(names)


@pytest.fixture(scope="module")
def points(virtual_session: Path, virtual_calibration: Calibration) -> tuple[Point, ...]:
    """Return three methods on two presses; the table has no balls to learn from."""
    scene = Scene("A", virtual_calibration, virtual_calibration)
    chosen = [m for m in methods() if m.name in ("table", "paper", "full_best")]
    names = ["cylinder_s5_d100.png", "cuboid_s4_d100.png"]
    presses = session_presses(read_session(virtual_session), names)
    return measure_scene(scene, presses, chosen, repeats=1)


def test_every_press_is_timed_and_scored_and_what_cannot_be_made_is_a_gap(
    points: tuple[Point, ...],
) -> None:
    paper, full, table = points
    assert table.gap and table.median_ms is None and table.rms_um is None
    assert paper.rms_um is not None and full.rms_um is not None
    assert full.rms_um < paper.rms_um < 60.0
    assert paper.normal_deg is not None and full.normal_deg is not None
    assert 0.5 < full.normal_deg < paper.normal_deg < 10.0
    for point in (paper, full):
        assert point.presses == 2
        assert point.p95_ms is not None and point.median_ms is not None
        assert point.p95_ms >= point.median_ms > 0.0
        assert point.rms_low_um is not None and point.rms_high_um is not None
        assert point.rms_low_um <= (point.rms_um or 0.0) <= point.rms_high_um
    assert full in fronts(points)


def test_a_smaller_camera_sees_the_same_sensor(
    small_session: Path, small_calibration: Calibration
) -> None:
    session = read_session(small_session)
    press = session_presses(session, ["cylinder_s5_d100.png"])[0]
    bare = smaller(session.averaged("background").rgb, 2)
    scene = at_scale(Scene("A", small_calibration, small_calibration), 0.5, bare)
    grid, before = scene.full.table.grid, small_calibration.table.grid
    assert grid.pitch_mm == pytest.approx(2.0 * before.pitch_mm, rel=0.01)
    half = replace(press, frame=smaller(press.frame, 2))
    chosen = [m for m in methods() if m.name in ("paper", "full_best")]
    paper, full = measure_scene(scene, [half], chosen, repeats=1)
    assert full.rms_um is not None and full.rms_um < 45.0
    assert paper.rms_um is not None and paper.rms_um < 80.0


def test_smaller_images_are_averages() -> None:
    frame = np.arange(2 * 4 * 3, dtype=np.float32).reshape(2, 4, 3)
    assert smaller(frame, 2)[0, 1] == pytest.approx(frame[:2, 2:].mean(axis=(0, 1)))
    assert smaller((10 * frame).astype(np.uint8), 2).dtype == np.uint8


def test_the_report_holds_every_method_and_the_machine(
    points: tuple[Point, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(work_precision, "measure_sensor", lambda *_, **__: points)
    monkeypatch.setattr(work_precision, "measure_integrators", lambda **_: ())
    monkeypatch.setattr(work_precision, "measure_leaving_out", lambda *_, **__: ())
    out = tmp_path / "out"
    arguments = ["work-precision", "-o", str(out), "--widths", "320", "--wait", "0"]
    assert main(arguments) == 0
    assert "observed order" in capsys.readouterr().out
    content = json.loads((out / "work-precision.json").read_text())
    assert {p["method"] for p in content["points"]} == {"paper", "full_best", "table"}
    gap = next(p for p in content["points"] if p["method"] == "table")
    assert gap["rms_um"] is None and gap["gap"]
    assert ["A", points[1].width, "full_best"] in content["front"]
    assert content["machine"]["processors"] >= 1
    with (out / "work-precision.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == 2 * len(points)
    assert (out / "work-precision.html").read_text().count("data:image/png") == 2
    assert (out / "front-A.png").read_bytes().startswith(b"\x89PNG")


def test_one_calibration_is_measured_as_it_is(
    small_calibration: Calibration, small_session: Path, tmp_path: Path
) -> None:
    file = tmp_path / "small.gplcal"
    write_calibration(small_calibration, file)
    arguments = ["work-precision", str(small_session), "--calibration", str(file), "--repeats", "1"]
    out = tmp_path / "out"
    common = ["--methods", "paper,table", "--wait", "0", "-o", str(out)]
    assert main([*arguments, *common]) == 0
    points = json.loads((out / "work-precision.json").read_text())["points"]
    paper, table = points
    assert paper["rms_um"] > 0.0 and paper["median_ms"] > 0.0
    assert table["gap"] and table["rms_um"] is None


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["--methods", "paper,magic"], "magic"),
        (["--widths", "320,x"], "widths"),
        (["--widths", "10"], "widths"),
        (["--no-virtual"], "no sensor"),
        (["nowhere"], "session.toml"),
    ],
)
def test_what_cannot_be_measured_is_refused_before_the_work(
    tmp_path: Path, arguments: list[str], output: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["work-precision", *arguments, "-o", str(tmp_path / "out")]) == MENDABLE
    assert output in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
