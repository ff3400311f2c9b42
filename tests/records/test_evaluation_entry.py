"""Evaluations in the lab's records."""

from dataclasses import replace

import pytest

from gelpolight_core.measurement.evaluation import Evaluation
from gelpolight_core.measurement.press import Press
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.records.evaluation_entry import add_once, evaluation_record
from gelpolight_core.records.records import NAME, open_records
from gelpolight_core.reference import Truth
from tests.measurement.maps import measurement

FIT = measurement("cylinder", 5.0, 1.0)


def evaluation(*errors: tuple[float, float], failed: int = 0) -> Evaluation:
    press = Press("p.png", Truth("cylinder", 5.0, height_mm=1.0), outcome="too dark")
    good = [
        replace(press, outcome=replace(FIT, diameter_mm=5 + size / 20, height_mm=1 + depth / 100))
        for size, depth in errors
    ]
    return Evaluation((*good, *[press] * failed), ())


def record(found: Evaluation) -> object:
    return evaluation_record(found, serial="A", calibration_id="A-1", folder="run")


def test_the_mean_errors_are_stored_and_judged_by_the_limits():
    kept = record(evaluation(*[(2.0, -4.0), (-4.0, 6.0)] * 5))
    assert kept.quantity("planar_error_percent").value == pytest.approx(3.0)
    assert kept.quantity("depth_error_percent").value == pytest.approx(5.0)
    assert kept.verdict == "pass"
    assert record(evaluation((6.0, 1.0))).verdict == "fail"
    assert record(evaluation((2.0, 1.0))).verdict == "undecided"  # a single press
    assert record(evaluation(*[(4.9, 1.0)] * 9)).verdict == "undecided"  # 5 % less 0.3 %
    assert record(evaluation((1.0, 1.0), failed=1)).verdict == "doubtful"
    assert record(evaluation(failed=2)) is None


def test_the_same_evaluation_is_stored_once(tmp_path):
    records = open_records(tmp_path / NAME)
    try:
        first = add_once(records, record(evaluation((2.0, 2.0))))
        assert first > 0
        assert add_once(records, record(evaluation((2.0, 2.0)))) == 0
        assert add_once(records, record(evaluation((2.0, 3.0)))) > first
        assert [r.shape for r in records.all(MeasurementRecord)] == ["evaluation"] * 2
    finally:
        records.close()
