"""Measured and true values: errors, limits, and the record of a result. Without Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from app.measure.figures_text import unit_behind, unit_of
from app.services.preferences import Limits
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.measurement.result import Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict, tool_as_dict
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.records.entry import MeasurementRecord, Quantity, verdict_of
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
    fit = result.measurement
    if fit is not None:
        size_name = "diameter_mm" if fit.side_mm is None else "side_mm"
        sds = (fit.size_sd_mm, fit.sd.get("height_mm"))
        size_sd_mm, height_sd_mm = (x if x is not None and math.isfinite(x) else None for x in sds)
        return (
            Quantity(
                size_name, fit.size_mm, size_sd_mm, _checked(stated.size_mm), limits.size_percent
            ),
            Quantity(
                "height_mm",
                fit.height_mm,
                height_sd_mm,
                _checked(stated.height_mm),
                limits.height_percent,
            ),
        )
    first, *others = (Quantity(f"{f.name}_{f.unit}", f.value, f.sd) for f in result.figures)
    if stated.size_mm is None:
        return (first, *others)
    # The sign of a step only depends on the order of the clicks.
    in_depth = result.figures[0].name in DEPTH_FIGURES
    value = abs(first.value) if in_depth else first.value
    limit = limits.height_percent if in_depth else limits.size_percent
    first = replace(first, value=value, truth=_checked(stated.size_mm), limit_percent=limit)
    return (first, *others)


def _checked(true: float | None) -> float | None:
    if true is not None and not (math.isfinite(true) and true > 0.0):
        raise InputError(
            tr("The true value is {value}").format(value=true),
            where=tr("True value"),
            advice=tr("Enter a value greater than zero"),
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
    fit, size_mm, height_mm = result.measurement, stated.size_mm, stated.height_mm
    quantities = quantities_of(result, stated, limits)
    if fit is None:
        shape, details = result.tool.name.replace("-", "_"), result_as_dict(result)
    elif size_mm is None or height_mm is None:
        shape, details = fit.shape, fit.as_json()
    else:
        shape = fit.shape
        details = fit.as_json(compare(fit, Truth(shape, size_mm, height_mm)))
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
