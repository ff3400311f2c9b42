"""The bench presses the protocol by itself, can be stopped at any press, and reports."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.command_line.main import MENDABLE, main
from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.experiments import virtual_protocol
from gelpolight_core.experiments.press_workers import Equipment
from gelpolight_core.experiments.virtual_protocol import (
    calibrate_virtual_sensor,
    evaluate_run,
    press_protocol,
    run_ledger,
)
from gelpolight_core.measurement.protocol import Protocol
from gelpolight_core.measurement.protocol_run import ProtocolRun, begin_run, open_run
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import Calibration

SMALL = SensorDesign().scaled(0.25)
PART = Protocol(sizes_mm=(5.0,), heights_mm=(), repeats=0, regions=1)


@pytest.fixture(scope="module")
def calibration(small_calibration: Calibration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("calibration") / "sensor.gplcal"
    write_calibration(small_calibration, path)
    return path


def begun(folder: Path, calibration: Path) -> tuple[ProtocolRun, Reconstructor]:
    reconstructor = Reconstructor(read_calibration(calibration))
    made = reconstructor.calibration
    run = begin_run(folder, PART, serial=made.sensor.serial, calibration=made.identity)
    return run, reconstructor


@pytest.fixture(scope="module")
def done(calibration: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a finished run of two objects."""
    folder = tmp_path_factory.mktemp("done") / "run"
    run, reconstructor = begun(folder, calibration)
    ledger = run_ledger(run, reconstructor)
    press_protocol(run, Equipment(calibration, design=SMALL), ledger, workers=1)
    return folder


def test_the_bench_presses_everything_and_the_errors_are_small(
    done: Path, calibration: Path
) -> None:
    run = open_run(done)
    assert run.next() is None
    reconstructor = Reconstructor(read_calibration(calibration))
    evaluation = evaluate_run(run, reconstructor, run_ledger(run, reconstructor))
    assert not evaluation.failed
    # A quarter of the image's size has four times the pitch: the bars are the paper's.
    assert evaluation.overall("planar").mean_absolute_percent < 5.0
    assert evaluation.overall("depth").mean_absolute_percent < 8.0


def test_a_run_that_is_stopped_goes_on_with_the_same_bytes(
    done: Path, calibration: Path, tmp_path: Path
) -> None:
    run, reconstructor = begun(tmp_path / "run", calibration)
    equipment = Equipment(calibration, design=SMALL)

    def stop(name: str, share: float) -> None:
        if share >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        press_protocol(run, equipment, run_ledger(run, reconstructor), workers=1, progress=stop)
    again = open_run(run.folder)
    assert len(again.done) == 1
    reported: list[str] = []
    press_protocol(
        again,
        equipment,
        run_ledger(again, reconstructor),
        workers=1,
        progress=lambda name, _: reported.append(name),
    )
    assert reported == ["press 2 of 2"]
    for press in again.wanted:
        assert again.image(press).read_bytes() == (done / "presses" / press.file).read_bytes()


def test_what_was_pressed_is_evaluated_alike_by_one_process_or_two(
    done: Path, calibration: Path, tmp_path: Path
) -> None:
    """The numbers of the run, of one process and of several are the same.

    To rounding, not to the last bit: one process may compile a kernel that another one loads, and
    the compiler may order a sum otherwise.
    """
    for name, workers in (("one", "1"), ("two", "2")):
        arguments = ["evaluate", str(calibration), str(done), "-o", str(tmp_path / name)]
        assert main([*arguments, "--workers", workers]) == 0
    run = open_run(done)
    reconstructor = Reconstructor(read_calibration(calibration))
    on_screen = evaluate_run(run, reconstructor, run_ledger(run, reconstructor))
    one, two = (
        list(csv.DictReader((tmp_path / name / "evaluation.csv").read_text().splitlines()))
        for name in ("one", "two")
    )
    assert [row["file"] for row in one] == [row["file"] for row in two]
    for row, other, result in zip(one, two, on_screen.results, strict=True):
        assert result.measurement is not None
        for name, value in (
            ("size_mm", result.measurement.size_mm), ("height_mm", result.measurement.height_mm),
        ):  # fmt: skip
            assert float(row[name]) == pytest.approx(value, rel=1e-6)
            assert float(other[name]) == pytest.approx(value, rel=1e-6)


def test_the_command_goes_on_with_a_run_and_reports(
    done: Path, calibration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    camera = SMALL.camera
    (tmp_path / "small.toml").write_text(
        f"[camera]\nwidth_px = {camera.width_px}\nheight_px = {camera.height_px}\n"
        f"fx = {camera.fx}\nfy = {camera.fy}\ncx = {camera.cx}\ncy = {camera.cy}\n"
    )
    arguments = ["protocol", str(folder), "--design", str(tmp_path / "small.toml")]
    arguments += ["--calibration", str(calibration), "--shapes", "cylinder", "--sizes", "5"]
    arguments += ["--heights", "--regions", "0", "--workers", "1"]
    assert main([*arguments, "--repeats", "1"]) == 0
    captured = capsys.readouterr()
    assert "press 1 of 1" in captured.err
    assert "cylinder_s500_h100_same_1.png" in captured.out
    report = json.loads((folder / "report" / "evaluation.json").read_text())
    assert report["overall"]["planar"]["count"] == 1
    assert main([*arguments, "--repeats", "1"]) == 0
    capsys.readouterr()
    assert main([*arguments, "--repeats", "2"]) == MENDABLE
    assert "another protocol or calibration" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "summary"),
    [
        (["--sizes", "-1"], "sizes_mm contains -1"),
        (["--repeats", "0", "--regions", "0"], "the protocol contains no press"),
        (["--seed", "-1"], "The seed is -1"),
    ],
)
def test_a_protocol_that_cannot_be_pressed_is_refused_before_anything_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], summary: str
) -> None:
    assert main(["protocol", str(tmp_path / "run"), *arguments]) == MENDABLE
    assert summary in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_sensor_is_calibrated_once_and_from_a_whole_session_only(
    small_session: Path,
    small_calibration: Calibration,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What a killed call left of a session is made anew; what it finished is not."""
    made_in: list[str] = []

    def simulate(design: SensorDesign, out: Path, *, progress: object) -> None:
        made_in.append(out.name)
        shutil.copytree(small_session, out)

    monkeypatch.setattr(virtual_protocol, "simulate_session", simulate)
    monkeypatch.setattr(
        virtual_protocol,
        "calibrate_session",
        lambda session, **_: SimpleNamespace(calibration=small_calibration),
    )
    (tmp_path / "session.part" / "balls").mkdir(parents=True)
    made = calibrate_virtual_sensor(SMALL, tmp_path)
    assert read_calibration(made).identity == small_calibration.identity
    assert not (tmp_path / "session.part").exists()
    made.unlink()
    assert calibrate_virtual_sensor(SMALL, tmp_path) == made
    stamp = made.stat().st_mtime_ns
    assert calibrate_virtual_sensor(SMALL, tmp_path) == made
    assert made.stat().st_mtime_ns == stamp
    assert made_in == ["session.part"]
