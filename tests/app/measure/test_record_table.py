"""The records as a table."""

from app.measure.record_table import record_cells
from app.theme.icons import icon
from gelpolight_core.quantity import Quantity
from gelpolight_core.records.entry import MeasurementRecord


def test_an_evaluation_has_a_row_with_its_mean_errors(qapp):
    quantities = Quantity("planar_error_percent", 2.0), Quantity("depth_error_percent", 4.0)
    cells = record_cells(MeasurementRecord("A", "A-1", "evaluation", quantities, "pass"))
    texts = [cell.text for cell in cells]
    assert "Evaluation (mean errors)" in texts
    assert {"2.00 %", "4.00 %"} <= set(texts)
    for cell in cells:
        if cell.icon:
            icon(cell.icon, cell.role)
