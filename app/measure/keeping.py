"""The record of a result. Without Qt."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.measure.judging import Judged, Stated
from app.services.preferences import Limits
from gelpolight_core.measurement.result import Measurement, Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict, tool_as_dict
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.records.entry import MeasurementRecord, Quantity, indenter_record, verdict_of


@dataclass(frozen=True, slots=True)
class Kept:
    """A result with its context.

    Attributes
    ----------
    result : ToolResult
        Result of a tool.
    judged : tuple of Judged
        Comparison with the true values. Empty if there are none.
    stated : Stated
        The true values as entered.
    limits : Limits
        Limits of the verdict.
    heightmap : HeightMap
        The height map that was measured.
    serial : str
        The sensor.
    operator, note : str
        Operator, and their note.
    """

    result: ToolResult
    judged: tuple[Judged, ...]
    stated: Stated
    limits: Limits
    heightmap: HeightMap
    serial: str
    operator: str
    note: str


def record_of(kept: Kept) -> MeasurementRecord:
    """Return the record to be saved."""
    fit = kept.result.measurement
    record = _other_record(kept) if fit is None else _fit_record(kept, fit)
    settings = {"model": kept.heightmap.model, "tool": tool_as_dict(kept.result.tool)}
    if kept.stated.name:
        settings["indenter"] = kept.stated.name
    quantities = _with_truth(record.quantities, kept)
    return replace(
        record,
        quantities=quantities,
        verdict=verdict_of(quantities, doubtful=kept.result.verdict != "ok"),
        settings=settings,
    )


def _fit_record(kept: Kept, fit: Measurement) -> MeasurementRecord:
    stated = kept.stated
    comparison = None
    if stated.size_mm is not None and stated.height_mm is not None:
        comparison = compare(fit, Truth(fit.shape, stated.size_mm, stated.height_mm))
    return indenter_record(
        fit,
        comparison,
        serial=kept.serial,
        calibration_id=kept.heightmap.calibration_id,
        size_limit_percent=kept.limits.size_percent,
        height_limit_percent=kept.limits.height_percent,
        operator=kept.operator,
        picture=kept.heightmap.source,
        note=kept.note,
    )


def _other_record(kept: Kept) -> MeasurementRecord:
    return MeasurementRecord(
        serial=kept.serial,
        calibration_id=kept.heightmap.calibration_id,
        shape=kept.result.tool.name.replace("-", "_"),
        quantities=tuple(
            Quantity(f"{figure.name}_{figure.unit}", figure.value, figure.sd)
            for figure in kept.result.figures
        ),
        reason=kept.result.reason,
        details=result_as_dict(kept.result),
        operator=kept.operator,
        picture=kept.heightmap.source,
        note=kept.note,
    )


def _with_truth(quantities: tuple[Quantity, ...], kept: Kept) -> tuple[Quantity, ...]:
    """Put the true values next to the measured ones: size first, then depth."""
    found = list(quantities)
    for row in kept.judged:
        index = 1 if row.quantity == "height" and kept.result.measurement is not None else 0
        found[index] = replace(
            found[index], value=row.measured, truth=row.true, limit_percent=row.limit_percent
        )
    return tuple(found)
