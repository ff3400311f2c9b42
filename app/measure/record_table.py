"""The records as a table: one row per measurement, sortable and filterable."""

from __future__ import annotations

from dataclasses import replace

from app.widgets.cells_table import TableCell
from app.widgets.icons import tool_icon
from gelpolight_core.base.compared_quantity import DECISIONS, Quantity, value_text
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.lab.measurement_record import DOUBTFUL, FILE, STORED, MeasurementRecord
from gelpolight_core.measurement.tools.tool_registry import palette_entry

_FIGURES = "Size or figure", "Error", "Height", "Height error"
TITLES = ("Date", "Sensor", "Object", "Verdict", *_FIGURES, "Operator", "Note", "Image")
NOTE, IMAGE = 9, 10
"""Columns."""
EVALUATION = "evaluation"
"""Shape of an evaluation, which earlier versions kept among the records."""
VERDICTS = {stored: (DECISIONS[verdict], verdict.value) for verdict, stored in STORED.items()} | {
    DOUBTFUL: ("doubtful", "warn")
}
"""Word and role of each stored verdict."""


def verdict_role(role: str, *quantities: Quantity, doubtful: bool = False) -> str:
    """Return the role of a verdict. What is doubtful or unexplained is no pass.

    Parameters
    ----------
    role : str
        ``pass``, ``warn``, ``fail``, or empty without a verdict.
    quantities : Quantity
        What was judged.
    doubtful : bool, optional
        Whether the measurement or its reference is.
    """
    judged = QualityTable(tuple(f for quantity in quantities for f in quantity.findings))
    return "warn" if role == Verdict.PASS and (doubtful or judged.verdict != role) else role


def shape_label(shape: str) -> str:
    """Return the name of the measured object or figure."""
    if shape == EVALUATION:
        return "Evaluation (mean errors)"
    return palette_entry(shape.replace("_", "-")).label


def _shape_icon(shape: str) -> str:
    return "report" if shape == EVALUATION else tool_icon(shape.replace("_", "-"))


def record_cells(record: MeasurementRecord) -> tuple[TableCell, ...]:
    """Return the cells of a measurement."""
    word, role = VERDICTS.get(record.verdict, ("no true value", ""))
    role = verdict_role(role, *record.quantities)
    doubtful = record.verdict == DOUBTFUL
    time = f"{record.time.astimezone():%Y-%m-%d %H:%M}"
    cells = (
        TableCell(time, key=record.time.timestamp()),
        TableCell(record.serial),
        TableCell(shape_label(record.shape), _shape_icon(record.shape)),
        TableCell(word, role, role),
        *_figure_cells(record.quantities[0], doubtful=doubtful),
        *_figure_cells(_depth(record), doubtful=doubtful),
        *map(TableCell, (record.operator, record.note, record.picture)),
    )
    return tuple(replace(cell, tip=_tip(record)) for cell in cells)


def _figure_cells(quantity: Quantity | None, *, doubtful: bool) -> tuple[TableCell, TableCell]:
    """Return the cells of a value with its error."""
    if quantity is None:
        return TableCell("", key=-1e9), TableCell("", key=-1e9)
    value = TableCell(quantity.text, key=quantity.value, right=True)
    if quantity.error is None or quantity.error_percent is None:
        return value, TableCell("", key=-1e9)
    error = value_text(quantity.error, unit=quantity.unit, sign="+")
    return value, TableCell(
        f"{error}, {quantity.error_percent:+z.2f} %",
        role=verdict_role(quantity.verdict or "", quantity, doubtful=doubtful),
        key=quantity.error_percent,
        right=True,
    )


def _depth(record: MeasurementRecord) -> Quantity | None:
    return record.quantity("height_mm") or record.quantity("depth_error_percent")


def _tip(record: MeasurementRecord) -> str:
    lines = [f"{quantity.name}: {quantity.text}" for quantity in record.quantities]
    lines.append(f"calibration {record.calibration_id}")
    file = record.settings.get(FILE)
    lines.append(f"double-click to open {file}" if file else "its image was not kept as a file")
    if record.reason:
        lines.append(f"doubtful: {record.reason}")
    return "\n".join(lines)
