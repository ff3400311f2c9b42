"""Error against run time as its reader meets it: modes, front, recommendation."""

import csv
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from app.cli.main import main
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.lab.depth_score import TrueDepth
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies import work_precision
from gelpolight_core.studies.work_precision import (
    WorkPrecisionPoint,
    mean_within,
    measure_session,
    measure_virtual,
    new_presses,
    normal_error_deg,
    pareto_front,
)

POINT = WorkPrecisionPoint("A", "a", "A", 1280, 0.02, 4, 10.0, 12.0, 5.0, 1.0, 1.0, 1.0)


def at(ms: float, um: float, **others: object) -> WorkPrecisionPoint:
    return replace(POINT, median_ms=ms, p95_ms=ms, rms_um=um, **others)  # type: ignore[arg-type]


def test_the_front_is_what_nothing_beats_in_both_time_and_error():
    points = [at(10, 5), at(5, 9), at(20, 6), at(5, 8), at(40, 1), at(4, 9, width=320)]
    front = {(p.median_ms, p.rms_um) for p in pareto_front(points)}
    assert front == {(5, 8), (10, 5), (40, 1), (4, 9)}  # each width has one of its own


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0])
def test_the_error_of_a_normal_is_its_angle_to_the_true_one(tilt_deg):
    axis = np.linspace(-4.0, 4.0, 161)
    plane = TrueDepth(np.tile(0.5 + 0.1 * axis, (161, 1)), axis, axis)
    nodes = axis[20:-20:2]
    angle = np.arctan(0.1) + np.radians(tilt_deg)
    normals = np.full(
        (nodes.size, nodes.size, 3), [-np.sin(angle), 0.0, -np.cos(angle)], np.float32
    )
    depth, flags = np.zeros(normals.shape[:2], np.float32), np.zeros(normals.shape[:2], np.uint8)
    found = HeightMap(depth, nodes, nodes, 0.1, normals, flags, "id", "full", "")
    assert normal_error_deg(found, plane, 3.0) == pytest.approx(tilt_deg, abs=0.03)


@pytest.fixture(scope="module")
def two_presses(small_session, tmp_path_factory):
    """Return the small session with a cylinder and a cuboid."""
    folder = tmp_path_factory.mktemp("two") / "session"
    shutil.copytree(small_session, folder)
    truth = folder / "presses" / "truth.csv"
    names = ("file", "cylinder_s5_d100.png", "cuboid_s4_d100.png")
    truth.write_text("\n".join(r for r in truth.read_text().splitlines() if r.startswith(names)))
    return folder


@pytest.mark.function(
    "`gelpolight work-precision --curves`: error against rounds, steps and tolerance"
)
def test_a_curve_changes_one_parameter_of_the_best_mode(
    two_presses, small_calibration, monkeypatch
):
    monkeypatch.setattr(work_precision, "CURVES", {"tolerance": (0.3, 3e-4), "steps": (1,)})
    points = measure_session(two_presses, small_calibration, repeats=1, curves=True)
    um = {point.mode: point.rms_um for point in points}
    assert [p.mode for p in points if p.curve == "tolerance"] == [
        "tolerance = 0.3",
        "tolerance = 0.0003",
    ]
    paper, best = (next(p for p in points if p.mode == mode) for mode in ("paper", "best"))
    assert {p.mode for p in points if not p.curve} == {"paper", "fast", "balanced", "best"}
    assert best.rms_um < paper.rms_um < 60.0
    assert 0.5 < best.normal_deg < paper.normal_deg < 10.0
    for point in points:
        assert point.presses == 2 and all(0.0 < within for within in point.within)
        assert point.p95_ms >= point.median_ms > 0.0
    # The mode's own value changes nothing, a loose one does; the mode itself is left as it was.
    assert um["tolerance = 0.0003"] == um["best"] < 0.9 * um["tolerance = 0.3"]
    assert um["steps = 1"] != um["best"]
    front = pareto_front(points)
    assert best in front and all(not point.curve for point in front)


def test_new_presses_follow_the_seed_and_stay_inside_the_compared_area():
    design = SensorDesign()
    drawn = [new_presses(design, seed, 40) for seed in (0, 1, 1)]
    assert drawn[0] != drawn[1] == drawn[2]
    assert {press.shape for press in drawn[0]} == {"cylinder", "cuboid"}
    reach = [np.hypot(p.x_mm, p.y_mm) + p.size_mm / np.sqrt(2.0) + p.depth_mm for p in drawn[0]]
    assert max(reach) < 0.5 * design.membrane.working_diameter_mm
    assert not {p.size_mm for p in drawn[0]} & {p.size_mm for p in design.presses}


def test_nineteen_of_twenty_intervals_hold_the_mean_and_one_press_has_none():
    errors = np.random.default_rng(5).normal(3.0, 1.0, (8, 4000))
    means, within = map(np.array, mean_within(errors))
    assert np.mean(np.abs(means - 3.0) <= within) == pytest.approx(0.95, abs=0.02)
    assert np.isnan(mean_within(errors[:1])[1]).all()


def test_the_virtual_sensor_is_calibrated_at_each_width(
    small_session, small_calibration, monkeypatch
):
    scales: list[float] = []

    def simulate(design: SensorDesign, out: Path, *, scale: float, **_: object) -> None:
        scales.append(scale)
        assert design.presses == new_presses(SensorDesign(), 0)
        shutil.copytree(small_session, out)

    monkeypatch.setattr(work_precision, "simulate_session", simulate)
    monkeypatch.setattr(
        work_precision,
        "run_calibration",
        lambda *_, **__: SimpleNamespace(calibration=small_calibration),
    )
    shares: list[float] = []
    points = measure_virtual(
        SensorDesign(), widths=(320, 640), repeats=1, progress=lambda _, share: shares.append(share)
    )
    assert scales == [0.25, 0.5] and len(points) == 2 * 4
    assert shares == sorted(shares) and shares[-1] == 1.0


@pytest.mark.function("`gelpolight work-precision`: error against run time")
def test_one_calibration_is_measured_on_the_presses_of_a_session(
    small_calibration, two_presses, tmp_path, capsys
):
    file, out = tmp_path / "c.gplcal", tmp_path / "out"
    write_calibration(small_calibration, file)
    arguments = ["work-precision", str(two_presses), "--calibration", str(file), "-o", str(out)]
    assert main([*arguments, "--repeats", "1"]) == 0
    assert "Full model, best" in capsys.readouterr().out
    with (out / "work-precision.csv").open() as stream:
        rows = {row["mode"]: row for row in csv.DictReader(stream)}
    assert float(rows["best"]["rms_um"]) > 0.0 and rows["best"]["on_front"] == "True"
    assert (out / "work-precision.png").read_bytes().startswith(b"\x89PNG")


def test_presses_of_another_sensor_are_refused(two_presses, small_calibration):
    other = small_calibration.changed(sensor=replace(small_calibration.data.sensor, serial="other"))
    with pytest.raises(InputError, match="other"):
        measure_session(two_presses, other)
    with pytest.raises(InputError, match="other"):
        measure_virtual(SensorDesign(), other)
