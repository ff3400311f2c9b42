"""Error against run time as its reader meets it: methods, fronts, orders, gaps."""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.command_line.main import MENDABLE, main
from gelpolight_core.experiments.integrators import measure_integrators
from gelpolight_core.experiments.methods import methods
from gelpolight_core.experiments.work_precision import (
    Point,
    normal_error_deg,
    observed_order,
    pareto_front,
)
from gelpolight_core.experiments.work_precision_report import point_table
from gelpolight_core.measurement.score import TrueDepth
from gelpolight_core.optics.resampling import MembraneGrid

BALLS, PRESS = 4, "cylinder_s5_d100.png"
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


def test_the_report_compares_methods_on_the_virtual_sensor(
    small_session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    thinned(small_session, out / "virtual-sensor-0.25")
    chosen = "directional,paper,full_best"
    arguments = ["--scales", "0.25", "--methods", chosen, "--repeats", "1"]
    assert main(["work-precision", "-o", str(out), *arguments]) == 0
    captured = capsys.readouterr()
    assert "observed order" in captured.out and "%" in captured.err
    content = json.loads((out / "work-precision.json").read_text())
    points = {p["method"]: p for p in content["points"]}
    assert list(points) == chosen.split(",")
    assert points["full_best"]["rms_um"] < points["paper"]["rms_um"]
    assert points["paper"]["rms_um"] < 0.5 * points["directional"]["rms_um"]
    assert points["full_best"]["normal_deg"] < points["paper"]["normal_deg"]
    assert all(p["p95_ms"] >= p["median_ms"] > 0.0 for p in points.values())
    assert ["virtual-sensor-0.25", "full_best"] in content["front"]
    with (out / "work-precision.csv").open() as stream:
        assert [row["method"] for row in csv.DictReader(stream)] == list(points)
    assert (out / "work-precision.html").read_text().count("data:image/png") == 3


def thinned(session: Path, folder: Path) -> None:
    """Copy a session with a few of its balls and one of its presses: its calibration is sooner."""
    shutil.copytree(session, folder)
    gone = [path.name for path in sorted((folder / "balls").iterdir())[BALLS:]]
    for name in gone:
        (folder / "balls" / name).unlink()
    lines = (folder / "session.toml").read_text().splitlines()
    kept = [line for line in lines if not any(line.startswith(f'"{name}"') for name in gone)]
    (folder / "session.toml").write_text("\n".join(kept))
    rows = (folder / "presses" / "truth.csv").read_text().splitlines()
    (folder / "presses" / "truth.csv").write_text(
        "\n".join(row for row in rows if row.startswith(("file", PRESS)))
    )


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
