"""Measured and true values: errors, limits, and the record of a result. Without Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from app.measure.figures_text import unit_behind, unit_of
from app.services.preferences import Limits
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.measurement.quantity import Quantity
from gelpolight_core.measurement.result import Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict, tool_as_dict
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.records.entry import MeasurementRecord, verdict_of
from gelpolight_core.translation import tr

DEPTH_FIGURES = frozenset({"step_height", "height", "depth_difference", "mean_depth", "deepest"})


@dataclass(frozen=True, slots=True)
class Stated:
    """The true values of an object, as the user entered them.

    Attributes
    ----------
    size_mm : float or None
        The diameter, the mean side, or the tool's first figure in its own unit. None: unknown.
    height_mm : float or None
        Indentation depth. None: unknown.
    name : str
        Name of the known indenter. Empty if the numbers were typed.
    """

    size_mm: float | None = None
    height_mm: float | None = None
    name: str = ""


def quantities_of(result: ToolResult, stated: Stated, limits: Limits) -> tuple[Quantity, ...]:
    """Return the measured values of a result, with their true values where they are known.

    Raises
    ------
    InputError
        If a given length is not greater than zero.
    """
    size_mm, height_mm = (_checked(x) for x in (stated.size_mm, stated.height_mm))
    fit = result.measurement
    if fit is not None:
        return compare(fit, _truth(fit.shape, size_mm, height_mm), limits.percent)
    first, *others = (Quantity(f"{f.name}_{f.unit}", f.value, f.sd) for f in result.figures)
    if size_mm is None:
        return (first, *others)
    # The sign of a step only depends on the order of the clicks.
    in_depth = result.figures[0].name in DEPTH_FIGURES
    value = abs(first.value) if in_depth else first.value
    limit = limits.percent[in_depth]
    return (replace(first, value=value, truth=size_mm, limit_percent=limit), *others)


def _truth(shape: str, *sizes_mm: float | None) -> Truth:
    return Truth(shape, *(math.nan if size is None else size for size in sizes_mm))


def _checked(true: float | None) -> float | None:
    if true is not None and not (math.isfinite(true) and true > 0.0):
        raise InputError(
            tr("The true value is {value}, not greater than zero").format(value=true),
            where=tr("True value"),
            advice=Remedy.CORRECT_VALUE,
        )
    return true


def judge(result: ToolResult, stated: Stated, limits: Limits) -> tuple[Finding, ...]:
    """Compare a result with its true values.

    Returns
    -------
    tuple of Finding
        The error of every value whose true value is known, in percent.

    Raises
    ------
    InputError
        If a given length is not greater than zero.
    """
    fit = result.measurement
    if fit is None:
        labels = [figure.label for figure in result.figures]
    else:
        labels = [tr("mean side") if fit.shape == "cuboid" else tr("diameter"), tr("depth")]
    return tuple(
        Finding(
            quantity.name,
            f"{label}: {quantity.error:+.3f}{unit_behind(unit_of(quantity.name))}",
            quantity.error_percent,
            "%",
            fail_limit=quantity.limit_percent,
            verdict=Verdict.PASS if quantity.passed else Verdict.FAIL,
        )
        for label, quantity in zip(labels, quantities_of(result, stated, limits), strict=True)
        if quantity.error_percent is not None
    )


def record_of(
    result: ToolResult,
    stated: Stated,
    heightmap: HeightMap,
    *,
    limits: Limits,
    serial: str,
    operator: str,
    note: str,
) -> MeasurementRecord:
    """Return the record to be saved.

    Parameters
    ----------
    result : ToolResult
        Result of a tool.
    stated : Stated
        The true values as entered.
    heightmap : HeightMap
        The height map that was measured.
    limits : Limits
        Limits of the verdict.
    serial : str
        The sensor.
    operator, note : str
        Operator, and their note.
    """
    fit, quantities = result.measurement, quantities_of(result, stated, limits)
    if fit is None:
        shape, details = result.tool.name.replace("-", "_"), result_as_dict(result)
    else:
        shape = fit.shape
        details = fit.as_json(_truth(shape, stated.size_mm, stated.height_mm))
    settings = {"model": heightmap.model, "tool": tool_as_dict(result.tool)}
    if stated.name:
        settings["indenter"] = stated.name
    return MeasurementRecord(
        serial=serial,
        calibration_id=heightmap.calibration_id,
        shape=shape,
        quantities=quantities,
        verdict=verdict_of(quantities, doubtful=result.verdict != "ok"),
        reason=result.reason,
        settings=settings,
        details=details,
        operator=operator,
        picture=heightmap.source,
        note=note,
    )
