"""The records as a table: one row per measurement, sortable and filterable."""

from __future__ import annotations

from dataclasses import replace

from app.measure.figures_text import unit_behind, unit_of, value_text
from app.measure.placing import kind_label
from app.widgets.cells_table import Cell
from gelpolight_core.quantity import DECISIONS, Quantity
from gelpolight_core.records.entry import DOUBTFUL, STORED, MeasurementRecord

NOTE, IMAGE = 9, 10
"""Columns."""
EVALUATION = "evaluation"
"""Shape of an evaluation, which earlier versions kept among the records."""
VERDICTS = {stored: (DECISIONS[verdict], verdict.value) for verdict, stored in STORED.items()} | {
    DOUBTFUL: ("doubtful", "warn")
}
"""Word and role of each stored verdict."""


def shape_label(shape: str) -> str:
    """Return the name of the measured object or figure."""
    if shape == EVALUATION:
        return "Evaluation (mean errors)"
    return kind_label(shape.replace("_", "-"))


def quantity_text(quantity: Quantity | None) -> str:
    """Return a value as text. Empty if there is none."""
    if quantity is None:
        return ""
    return value_text(quantity.value, quantity.sd, unit_of(quantity.name))


def error_text(quantity: Quantity | None) -> str:
    """Return an error in its unit and in percent. Empty if there is no true value."""
    if quantity is None or quantity.error is None or quantity.error_percent is None:
        return ""
    behind = unit_behind(unit_of(quantity.name))
    return f"{quantity.error:+.3f}{behind}, {quantity.error_percent:+.2f} %"


def record_titles() -> tuple[str, ...]:
    """Return the titles of the columns."""
    return (
        "Date",
        "Sensor",
        "Object",
        "Size or figure",
        "Error",
        "Depth",
        "Error",
        "Verdict",
        "Operator",
        "Note",
        "Image",
    )


def record_cells(record: MeasurementRecord) -> tuple[Cell, ...]:
    """Return the cells of a measurement."""
    word, role = VERDICTS.get(record.verdict, ("no true value", ""))
    sign = "report" if record.shape == EVALUATION else f"tool-{record.shape.replace('_', '-')}"
    time = f"{record.time.astimezone():%Y-%m-%d %H:%M}"
    cells = (
        Cell(time, key=record.time.timestamp()),
        Cell(record.serial),
        Cell(shape_label(record.shape), sign),
        *_figure_cells(record.quantities[0]),
        *_figure_cells(_depth(record)),
        Cell(word, role, role),
        *map(Cell, (record.operator, record.note, record.picture)),
    )
    return tuple(replace(cell, tip=_tip(record)) for cell in cells)


def _figure_cells(quantity: Quantity | None) -> tuple[Cell, Cell]:
    """Return a value and its error."""
    if quantity is None:
        return Cell("", key=-1e9), Cell("", key=-1e9)
    role = "" if quantity.verdict is None else quantity.verdict.value
    error = -1e9 if quantity.error_percent is None else quantity.error_percent
    return (
        Cell(quantity_text(quantity), key=quantity.value, right=True),
        Cell(error_text(quantity), role=role, key=error, right=True),
    )


def _depth(record: MeasurementRecord) -> Quantity | None:
    return record.quantity("height_mm") or record.quantity("depth_error_percent")


def _tip(record: MeasurementRecord) -> str:
    lines = [f"{quantity.name}: {quantity_text(quantity)}" for quantity in record.quantities]
    lines.append(f"calibration {record.calibration_id}")
    if record.reason:
        lines.append(f"doubtful: {record.reason}")
    return "\n".join(lines)
