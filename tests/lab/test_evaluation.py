"""The paper's evaluation on a folder of presses: statistics, reports, and nothing left out."""

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scene
from report_pdf import report_data, report_text

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.lab.evaluation import Evaluation, evaluate
from gelpolight_core.lab.evaluation_report import (
    evaluation_document,
    evaluation_table,
    write_evaluation_files,
)
from gelpolight_core.lab.evaluation_run import evaluate_presses
from gelpolight_core.lab.gauge_study import gauge_rows
from gelpolight_core.lab.reference_press import ReferencePress, read_truth
from gelpolight_core.measurement.drape import cylinder_depth
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.session.reference_object import ReferenceObject
from tests.measurement.maps import measurement, on_grid

HEADER = "file,shape,diameter_mm,side_mm,height_mm\n"


def press(shape: str, size: float, height: float, *, name: str = "") -> ReferencePress:
    return ReferencePress(
        name or f"{shape}_{size:g}_{height:g}.png", ReferenceObject(shape, size, height_mm=height)
    )


def evaluated_presses(sizes: Sequence[float], repeats: int) -> Evaluation:
    """Return presses whose heights scatter by 20 um."""
    rng = np.random.default_rng(0)
    rows, found = [], []
    for shape in ("cylinder", "cuboid"):
        for size in sizes:
            for k in range(repeats):
                rows.append(press(shape, size, 1.0, name=f"{shape}_{size:g}_{k}.png"))
                sized = size * (1.01 + 0.01 * rng.standard_normal())
                found.append(measurement(shape, sized, 1.02 + 0.02 * rng.standard_normal()))
    return evaluate(rows, found)


def test_errors_are_averaged_by_direction_shape_and_dimension():
    rows = [press("cylinder", 4.0, 1.0, name="a"), press("cylinder", 4.0, 0.5, name="b")]
    rows.append(press("cuboid", 5.0, 1.0, name="c"))
    found = [
        measurement("cylinder", 4.2, 0.9),
        measurement("cylinder", 3.9, 0.5),
        measurement("cuboid", 5.0, 1.2),
    ]
    evaluation = evaluate(rows, found)
    planar = evaluation.overall("planar")
    assert planar.mean_absolute == pytest.approx((5.0 + 2.5 + 0.0) / 3)
    assert planar.mean == pytest.approx((5.0 - 2.5 + 0.0) / 3)
    groups = {(g.direction, g.shape, g.dimension_mm): g.statistic for g in evaluation.groups}
    assert groups["planar", "cylinder", 4.0].count == 2
    assert groups["planar", "cylinder", 4.0].sd == pytest.approx(7.5 / math.sqrt(2))
    assert groups["depth", "cylinder", 1.0].mean == pytest.approx(-10.0)
    assert groups["depth", "all", None].highest == pytest.approx(20.0)


def test_a_press_that_could_not_be_measured_stays_with_its_reason(tmp_path):
    rows = [press("cylinder", 4.0, 1.0, name="a"), press("cylinder", 5.0, 1.0, name="b")]
    evaluation = evaluate(rows, [measurement("cylinder", 4.0, 1.0), "no object is pressed"])
    assert [r.file for r in evaluation.failed] == ["b"]
    assert "not measured: no object is pressed" in evaluation_table(evaluation)
    assert "1 of 2 presses could not be measured" in evaluation_table(evaluation)
    write_evaluation_files(evaluation, tmp_path)
    with (tmp_path / "evaluation.csv").open() as file:
        table = list(csv.DictReader(file))
    assert table[1]["verdict"] == "not measured"
    assert table[1]["reason"] == "no object is pressed"
    assert table[1]["size_mm"] == ""
    assert json.loads((tmp_path / "evaluation.json").read_text())["failed"] == 1


def heights(radius: float) -> HeightMap:
    place = np.arange(-8.0, 8.0, 0.08)
    distance = np.hypot(place[:, None], place[None, :])
    depth = cylinder_depth(
        distance, cylinder_radius_mm=radius, height_mm=1.0, decay_mm=0.7, edge_radius_mm=0.08
    )
    noise = 0.003 * np.random.default_rng(0).standard_normal(depth.shape)
    made = on_grid((depth + noise).astype(np.float32), place, place)
    return replace(made, depth_scale_sd=0.004, lateral_scale_sd=1e-4)


@pytest.mark.function("Evaluate a folder with truth.csv: table, figure, report")
def test_a_folder_of_presses_is_evaluated_from_end_to_end(tmp_path):
    (tmp_path / "truth.csv").write_text(
        HEADER + "a.png,cylinder,4.0,,1.0\nb.png,cylinder,6.0,,1.0\nc.png,cylinder,5,,1\n"
        "coin.png,coin,,,0.6\n"
    )
    for name in ("a.png", "b.png", "c.png"):
        (tmp_path / name).touch()

    def measure(path: Path, truth: ReferenceObject) -> Measurement:
        if path.name == "c.png":
            raise InputError("the image is all black", where=path.name, advice="Open the shutter")
        return measure_heightmap(
            heights({"a.png": 2.0, "b.png": 3.0}[path.name]), shape=truth.shape
        )

    reported: list[tuple[str, float]] = []
    evaluation = evaluate_presses(
        tmp_path, measure, progress=lambda name, share: reported.append((name, share))
    )
    # Nodes of 0.08 mm hardly show a fillet of 0.08 mm.
    assert evaluation.overall("planar").mean_absolute < 1.5
    assert [result.outcome for result in evaluation.failed] == [
        "c.png: the image is all black. Open the shutter."
    ]
    assert evaluation.skipped == ("coin.png",)
    # What the map knows of its calibration reaches the measurement.
    first = next(result.measurement for result in evaluation.results if result.measurement)
    assert first.calibration_sd is not None
    # The walls are steeper than what ball presses have shown the calibration.
    steeper = first.height_mm / first.drape_decay_mm / 0.85
    stated = 0.004 * steeper * first.height_mm
    assert first.calibration_sd["height_mm"] == pytest.approx(stated, rel=1e-2)
    assert "coin.png" in evaluation_table(evaluation)
    assert reported[0] == ("a.png", 0.0)
    assert reported[-1][1] == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,shape\na.png,ball\n", "column height_mm, diameter_mm is missing"),
        (HEADER + "a.png,ball,,,1\n", "line 2: diameter_mm is empty"),
        (HEADER + "a.png,ball,nan,,1\n", "diameter_mm: 'nan' is not a number"),
        (HEADER + "a.png,cylinder,5,002,1,0\n", "line 2: the line has 6 cells, the table has 5"),
        (HEADER + "a.png,cylinder,5,002,1\n", "side_mm is '002', which is no size of a cylinder"),
        ("file,shape,diameter_mm,height_mm\na.png,ball,5,002\n", "height_mm: '002' is not a num"),
        (HEADER.replace(",", ";") + "a.png;ball;1.234,5;;1\n", "1.234,5 could be 1234.5"),
        (HEADER + "a.png,ball,6,,-1\n", "height_mm is '-1'"),
        (HEADER + "a.png,ball,6,,1\n\na.png,ball,6,,1\n", "line 4: a.png is listed twice"),
        (HEADER + ",ball,6,,1\n", "names no file"),
        (HEADER + "a.png,coin,,,1\n", "no row with a cylinder"),
        ("", "is missing"),
    ],
)
def test_a_truth_file_that_cannot_be_used_says_where_and_why(tmp_path, text, message):
    (tmp_path / "truth.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_truth(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "file;shape;diameter_mm;height_mm;;\na.png;cylinder;5,002;1,0;;\n",
        'file,shape,diameter_mm,height_mm\na.png,cylinder,"5,002",1.0\n',
    ],
)
def test_a_decimal_comma_is_read_where_commas_separate_no_cells(tmp_path, text):
    (tmp_path / "truth.csv").write_text(text)
    (row,) = read_truth(tmp_path).rows
    assert (row.truth.size_mm, row.truth.height_mm) == (5.002, 1.0)


def test_columns_of_older_programs_are_read_and_an_unknown_depth_is_not_judged(tmp_path):
    (tmp_path / "truth.csv").write_text(
        "file,shape,diameter_mm,side_mm,height_mm,region,repeat,x_mm,y_mm,yaw_deg,captured\n"
        "a.png,cylinder,4.0,,1.0,same,1,0.0,0.0,0.0,2026-01-02\nb.png,cylinder,4.0,,,r01,1,2,1,,\n"
    )
    rows = read_truth(tmp_path).rows
    assert [row.truth.height_mm for row in rows] == [1.0, 0.0]
    evaluation = evaluate(rows[1:], [measurement("cylinder", 4.04, 1.0)])
    document = evaluation_document(evaluation)
    assert document.verdict is Verdict.WARN  # too few, but no missing error
    assert document.validation is not None
    assert "planar direction 1.00 %" in document.validation.sentence
    assert "nan" not in document.validation.sentence and "depth" not in document.validation.sentence
    assert evaluation.overall("depth").count == 0
    assert evaluation.rows[0]["true_height_mm"] is None


@pytest.mark.function("State the repeatability of objects pressed more than once")
def test_the_gauge_states_the_repeatability_of_every_object_pressed_more_than_once():
    rows = [press("cuboid", 5.0, 1.0, name=str(k)) for k in range(3)]
    rows += [press("cuboid", 5.0, 0.5, name=str(k)) for k in range(3, 5)]
    heights_mm = [0.99, 1.0, 1.01, 0.51, 0.51]
    found: list[Measurement | str] = [measurement("cuboid", 5.0, h) for h in heights_mm]
    *_, pooled, shallow, deep = gauge_rows(evaluate(rows, found))
    assert (deep.true_mm, deep.measured.count, shallow.true_mm) == (1.0, 3, 0.5)
    assert deep.measured.mean == pytest.approx(1.0)
    assert deep.repeatability_mm == pytest.approx(0.01)
    assert shallow.repeatability_mm == pytest.approx(0.0)
    assert pooled.truth is None and pooled.measured.count == 5
    assert pooled.repeatability_mm == pytest.approx(math.sqrt(2.0 / 3.0) * 0.01)
    found[1:3] = ["no object is pressed"] * 2
    assert {row.true_mm for row in gauge_rows(evaluate(rows, found)) if row.truth} == {5.0, 0.5}
    assert gauge_rows(evaluate(rows[:1], found[:1])) == ()


@pytest.mark.function("Hear how many presses an evaluation lacks")
def test_too_few_presses_neither_pass_nor_tell_their_scatter():
    rows = [press("cuboid", 5.0, 1.0, name=str(k)) for k in range(9)]
    found = [measurement("cuboid", 5.0, 1.0 + 0.001 * k) for k in range(9)]

    def verdicts(count: int) -> dict[str, Verdict]:
        document = evaluation_document(evaluate(rows[:count], found[:count]))
        return {
            figure.key: figure.verdict for s in document.sections for figure in s.quality.figures
        }

    few, enough = verdicts(8), verdicts(9)
    assert (few["depth_mean"], few["depth_repeatability"]) == (Verdict.WARN, Verdict.WARN)
    assert (enough["depth_mean"], enough["depth_repeatability"]) == (Verdict.PASS, Verdict.PASS)
    wrong = evaluate(rows[:1], [measurement("cuboid", 6.0, 1.0)])
    assert evaluation_document(wrong).verdict is Verdict.FAIL


def test_the_report_is_whole(tmp_path):
    evaluation = evaluated_presses([5.0], 9)
    written = write_evaluation_files(evaluation, tmp_path, calibration=scene.calibration())
    assert {path.name for path in written} == {
        *(f"evaluation.{ending}" for ending in ("txt", "csv", "json", "png", "pdf")),
        "gauge.csv",
    }
    text = report_text(tmp_path / "evaluation.pdf")
    for output in ("T-1", "Repeatability, depth", "18 of 18 presses", "cuboid_5_8.png"):
        assert output in text
    data = report_data(tmp_path / "evaluation.pdf")
    assert data["verdict"] == "pass"
    assert data["data"]["evaluation"] == json.loads((tmp_path / "evaluation.json").read_text())
    with (tmp_path / "gauge.csv").open() as file:
        gauge = list(csv.DictReader(file))
    assert len(gauge) == 2 * 2
    assert {row["n"] for row in gauge} == {"9"}
    assert evaluation_document(evaluation).verdict is Verdict.PASS
    strict = evaluation_document(replace(evaluation, limits_percent=(5.0, 0.1)))
    assert strict.verdict is Verdict.FAIL


def test_a_report_without_repeats_or_measurements_says_so(tmp_path):
    evaluation = evaluate([press("ball", 6.0, 0.8)], ["the image is all black"])
    written = write_evaluation_files(evaluation, tmp_path)
    assert "gauge.csv" not in {path.name for path in written}
    text = report_text(tmp_path / "evaluation.pdf")
    assert "None of 1 presses could be measured" in text
    assert "the image is all black" in text
