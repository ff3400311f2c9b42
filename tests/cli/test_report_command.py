"""The report on the command line, validated with presses of known size."""

import csv
import hashlib
import json
import math
import shutil

import pytest
from one_line import refusal
from report_pdf import report_data, report_text

from app.cli.main import main


@pytest.fixture
def run_folder(session, tmp_path):
    """Return two presses in the folder of a run that an earlier version began."""
    names = ("cuboid_s4_d100.png", "cylinder_s5_d050.png")
    presses = tmp_path / "run" / "presses"
    presses.mkdir(parents=True)
    for name in names:
        shutil.copy(session / "presses" / name, presses)
    rows = (session / "presses" / "truth.csv").read_text().splitlines()
    kept = [row for row in rows if row.startswith(("file", *names))]
    (presses / "truth.csv").write_text("\n".join(kept) + "\n")
    (presses.parent / "protocol.toml").write_text("format = 'gelpolight-protocol'\n")
    return presses.parent


@pytest.mark.function("`gelpolight report --presses`: a validated report")
def test_a_calibration_is_validated_with_the_numbers_of_the_evaluation(
    calibration, run_folder, tmp_path
):
    """Both commands accept the folder of a run, or that of its presses."""
    page, presses = tmp_path / "r.pdf", str(run_folder / "presses")
    assert main(["evaluate", str(calibration), str(run_folder), "-o", str(tmp_path / "e")]) == 0
    evaluation = json.loads((tmp_path / "e" / "evaluation.json").read_text())
    overall = evaluation["overall"]
    assert evaluation["tolerance_percent"] == {"planar": 5.0, "depth": 8.0}
    assert {overall[direction]["count"] for direction in ("planar", "depth")} == {2}
    arguments = ["report", str(calibration), "-o", str(page), "--presses", presses]
    assert main([*arguments, "--tolerance", "3", "40"]) == 0
    planar, depth = (overall[name]["mean_absolute_percent"] for name in ("planar", "depth"))
    validation = report_data(page)["validation"]
    assert validation["sentence"].startswith("Validation not decidable")  # two presses say little
    found = validation["data"]["overall"]
    assert found["planar"]["mean_absolute_percent"] == planar
    assert found["depth"]["mean_absolute_percent"] == depth
    assert validation["data"]["tolerance_percent"] == {"planar": 3.0, "depth": 40.0}
    assert f"depth direction {depth:.2f} % (tolerance 40 %)" in report_text(page)


def test_an_evaluation_gives_the_same_numbers_with_one_process_or_two(
    calibration, run_folder, tmp_path
):
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
def test_presses_without_a_folder_are_refused_before_any_work(run_folder, tmp_path, capsys, named):
    presses, page = str(run_folder / named), str(tmp_path / "r.pdf")
    line = refusal(capsys, "report", "none.gplcal", "-o", page, "--presses", presses)
    assert "not a folder" in line


@pytest.mark.function(
    "Write a certificate of measured sizes from which a stranger can decide again"
)
def test_whoever_has_the_certificate_alone_can_decide_again(calibration, press, tmp_path):
    """From what was measured, the budget, the reference and the tolerance in the attached data."""
    page, truth = tmp_path / "m.pdf", tmp_path / "truth.csv"
    truth.write_text(
        "file,shape,diameter_mm,height_mm,diameter_sd_mm,certificate,due\n"
        f"{press.name},cylinder,8.0,1.0,0.01,K-7,2020-01-31\n"
    )
    arguments = [str(press), "--shape", "cylinder", "--truth", str(truth), "--report", str(page)]
    assert main(["measure", str(calibration), *arguments]) == 0
    data = report_data(page)
    (measured,) = data["data"]["measurements"]
    assert measured["sha256"] == hashlib.sha256(press.read_bytes()).hexdigest()
    assert measured["truth"]["certificate"] == "K-7"
    decisions = {}
    for row in measured["comparisons"]:
        expanded = data["data"]["coverage_factor"] * math.hypot(*(b["sd"] for b in row["budget"]))
        deviation = abs(row["measured"] - row["true"])
        tolerance = row["true"] * row["tolerance_percent"] / 100.0
        assert row["en"] == pytest.approx(deviation / expanded)
        word = "not decidable"
        if deviation <= tolerance - expanded:
            word = "conforms"
        elif deviation > tolerance + expanded:
            word = "does not conform"
        decisions[row["quantity"]] = word
        assert row["decision"] == word
    assert decisions == {"diameter_mm": "does not conform", "height_mm": "not decidable"}
    (section,) = data["sections"]
    keys = {figure["key"] for figure in section["figures"]}
    assert {"deviation", "reference_due"} <= keys
    assert data["verdict"] == "fail"
    text = report_text(page)
    assert "does not conform" in text and "K-7" in text
