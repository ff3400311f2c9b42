"""The report on the command line, validated with presses of known size."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest
from one_line import refusal
from report_pdf import report_data, report_text

from app.command_line.main import main
from gelpolight_core.measurement.protocol import Protocol, ProtocolFile, write_protocol_file


@pytest.fixture
def run_folder(session: Path, tmp_path: Path) -> Path:
    """Return a run of the protocol with one press of each series, none of them of both."""
    names = ("cuboid_s4_d100.png", "cylinder_s5_d050.png")
    presses = tmp_path / "run" / "presses"
    presses.mkdir(parents=True)
    for name in names:
        shutil.copy(session / "presses" / name, presses)
    rows = (session / "presses" / "truth.csv").read_text().splitlines()
    kept = [row for row in rows if row.startswith(("file", *names))]
    (presses / "truth.csv").write_text("\n".join(kept) + "\n")
    write_protocol_file(ProtocolFile(Protocol(), "A", "c"), presses.parent)
    return presses.parent


def test_a_calibration_is_validated_with_the_numbers_of_the_evaluation(
    calibration: Path, run_folder: Path, tmp_path: Path
) -> None:
    """Both commands accept the folder of a run, or that of its presses."""
    page, presses = tmp_path / "r.pdf", str(run_folder / "presses")
    assert main(["evaluate", str(calibration), str(run_folder), "-o", str(tmp_path / "e")]) == 0
    overall = json.loads((tmp_path / "e" / "evaluation.json").read_text())["overall"]
    assert {overall[direction]["count"] for direction in ("planar", "depth")} == {1}
    assert main(["report", str(calibration), "-o", str(page), "--presses", presses]) == 0
    planar, depth = (overall[name]["mean_absolute_percent"] for name in ("planar", "depth"))
    found = report_data(page)["validation"]["data"]["overall"]
    assert found["planar"]["mean_absolute_percent"] == planar
    assert found["depth"]["mean_absolute_percent"] == depth
    assert f"depth direction {depth:.2f} %" in report_text(page)


def test_an_evaluation_gives_the_same_numbers_with_one_process_or_two(
    calibration: Path, run_folder: Path, tmp_path: Path
) -> None:
    """To rounding: the compiler may order a sum otherwise where a kernel is compiled again."""
    tables = []
    for workers in ("1", "2"):
        out = tmp_path / workers
        arguments = ["evaluate", str(calibration), str(run_folder), "-o", str(out)]
        assert main([*arguments, "--workers", workers]) == 0
        tables.append(list(csv.DictReader((out / "evaluation.csv").read_text().splitlines())))
    for one, two in zip(*tables, strict=True):
        assert one["file"] == two["file"]
        for name in ("size_mm", "height_mm"):
            assert float(one[name]) == pytest.approx(float(two[name]), rel=1e-6)


@pytest.mark.parametrize("named", ["presses/truth.csv", "none"])
def test_presses_without_a_folder_are_refused_before_any_work(
    run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], named: str
) -> None:
    presses, page = str(run_folder / named), str(tmp_path / "r.pdf")
    line = refusal(capsys, "report", "none.gplcal", "-o", page, "--presses", presses)
    assert "not a folder" in line
