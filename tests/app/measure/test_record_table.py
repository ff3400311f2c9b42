"""The records as a table."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from app.measure.record_table import RecordModel
from gelpolight_core.records.entry import MeasurementRecord, Quantity


def test_an_evaluation_has_a_row_with_its_mean_errors(qapp: QApplication) -> None:
    quantities = Quantity("planar_error_percent", 2.0), Quantity("depth_error_percent", 4.0)
    model = RecordModel()
    model.show((MeasurementRecord("A", "A-1", "evaluation", quantities, "pass"),))
    columns = range(model.columnCount())
    cells = [model.data(model.index(0, column)) for column in columns]
    assert "Evaluation (mean errors)" in cells
    assert {"2.00 %", "4.00 %"} <= set(cells)
    for column in columns:
        model.data(model.index(0, column), Qt.ItemDataRole.DecorationRole)
