"""Measured values beside their references, and the record of a result. Without Qt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from app.program.preferences import WarningLimits
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import Finding, join_reasons
from gelpolight_core.lab.measurement_record import FILE, MeasurementRecord, verdict_of
from gelpolight_core.measurement.result import compare_with_truth
from gelpolight_core.measurement.tools.tool_base import ToolResult
from gelpolight_core.measurement.tools.tool_registry import (
    DEPTH_FIGURES,
    result_as_dict,
    tool_as_dict,
)
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.session.reference_object import ReferenceObject


def doubts_of(result: ToolResult, reference: ReferenceObject) -> tuple[Finding, ...]:
    """Return why a comparison is doubtful: the result, or a reference whose calibration ended."""
    return (*result.findings, *reference.findings())


def quantities_of(
    result: ToolResult, reference: ReferenceObject, limits: WarningLimits
) -> tuple[Quantity, ...]:
    """Return the measured values of a result, with their true values where they are known."""
    fit = result.measurement
    if fit is not None:
        return compare_with_truth(fit, reference, limits.percent)
    first, *others = (figure.quantity for figure in result.figures)
    if not reference.size_mm:
        return (first, *others)
    # The sign of a step only depends on the order of the clicks.
    in_depth = result.figures[0].name in DEPTH_FIGURES
    value = abs(first.value) if in_depth else first.value
    limit = limits.percent[in_depth]
    compared = replace(
        first,
        value=value,
        truth=reference.size_mm,
        limit_percent=limit,
        truth_sd=reference.size_sd_mm,
    )
    return (compared, *others)


def record_of(
    result: ToolResult,
    reference: ReferenceObject,
    heightmap: HeightMap,
    *,
    limits: WarningLimits,
    serial: str,
    operator: str,
    note: str,
    file: Path | None = None,
) -> MeasurementRecord:
    """Return the record to be saved.

    Parameters
    ----------
    result : ToolResult
        Result of a tool.
    reference : ReferenceObject
        The true values.
    heightmap : HeightMap
        The height map that was measured.
    limits : WarningLimits
        Limits of the verdict.
    serial : str
        The sensor.
    operator, note : str
        Operator, and their note.
    file : Path, optional
        The image, if it is a file.
    """
    fit, quantities = result.measurement, quantities_of(result, reference, limits)
    if fit is None:
        shape, details = result.tool.name.replace("-", "_"), result_as_dict(result)
    else:
        shape, details = fit.shape, fit.as_json(reference, limits.percent)
    tool, path = tool_as_dict(result.tool), str(file or "")
    settings = {"model": heightmap.model, "tool": tool, FILE: path}
    if reference.name:
        settings["indenter"] = reference.name
    doubts = doubts_of(result, reference)
    return MeasurementRecord(
        serial=serial,
        calibration_id=heightmap.calibration_id,
        shape=shape,
        quantities=quantities,
        verdict=verdict_of(quantities, doubtful=bool(doubts)),
        reason=join_reasons(doubts),
        settings=settings,
        details=details,
        operator=operator,
        picture=heightmap.source,
        note=note,
    )
