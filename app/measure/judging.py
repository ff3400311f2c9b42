"""Measured and true values: errors, limits, and the record of a result. Without Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from app.services.preferences import Limits
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.measurement.result import Measurement, Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict, tool_as_dict
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.records.entry import MeasurementRecord, Quantity, indenter_record, verdict_of
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


@dataclass(frozen=True, slots=True)
class Judged:
    """One figure with its true value.

    Attributes
    ----------
    quantity : str
        ``size``, ``height`` or the figure's name.
    label, unit : str
        Text for the user.
    measured, true : float
        In `unit`.
    error_percent : float
        Signed, relative to the true value.
    limit_percent : float
        Maximum error to pass.
    """

    quantity: str
    label: str
    unit: str
    measured: float
    true: float
    error_percent: float
    limit_percent: float

    @property
    def error(self) -> float:
        """Measured minus true value, in `unit`."""
        return self.measured - self.true

    @property
    def passed(self) -> bool:
        """Whether the error is within the limit. False for values that are not finite."""
        return abs(self.error_percent) <= self.limit_percent


def judge(result: ToolResult, stated: Stated, limits: Limits) -> tuple[Judged, ...]:
    """Compare a result with its true values.

    Returns
    -------
    tuple of Judged
        Empty if no true value is given.

    Raises
    ------
    InputError
        If a given length is not greater than zero.
    """
    if result.measurement is not None:
        return _judge_indenter(result.measurement, stated, limits)
    if stated.size_mm is None:
        return ()
    figure = result.figures[0]
    true = stated.size_mm
    if not (math.isfinite(true) and true > 0.0):
        raise InputError(
            tr("The true value is {value}, not greater than zero").format(value=true),
            where=tr("True value"),
            advice=Remedy.CORRECT_VALUE,
        )
    # The sign of a step only depends on the order of the clicks.
    measured = abs(figure.value) if figure.name in DEPTH_FIGURES else figure.value
    in_depth = figure.name in DEPTH_FIGURES
    limit = limits.height_percent if in_depth else limits.size_percent
    error = 100.0 * (measured / true - 1.0)
    return (Judged(figure.name, figure.label, figure.unit, measured, true, error, limit),)


def _judge_indenter(fit: Measurement, stated: Stated, limits: Limits) -> tuple[Judged, ...]:
    if stated.size_mm is None and stated.height_mm is None:
        return ()
    # For unknown values the measured ones are used, and they are not reported.
    size = fit.size_mm if stated.size_mm is None else stated.size_mm
    height = fit.height_mm if stated.height_mm is None else stated.height_mm
    found = compare(fit, Truth(fit.shape, size, height))
    rows = []
    if stated.size_mm is not None:
        label = tr("mean side") if fit.shape == "cuboid" else tr("diameter")
        error, limit = found.size_error_percent, limits.size_percent
        rows.append(Judged("size", label, "mm", fit.size_mm, size, error, limit))
    if stated.height_mm is not None:
        error, limit = found.height_error_percent, limits.height_percent
        rows.append(Judged("height", tr("depth"), "mm", fit.height_mm, height, error, limit))
    return tuple(rows)


def record_of(
    result: ToolResult,
    judged: tuple[Judged, ...],
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
    judged : tuple of Judged
        Comparison with the true values. Empty if there are none.
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
    fit = result.measurement
    context = {
        "serial": serial,
        "calibration_id": heightmap.calibration_id,
        "operator": operator,
        "picture": heightmap.source,
        "note": note,
    }
    if fit is None:
        record = MeasurementRecord(
            shape=result.tool.name.replace("-", "_"),
            quantities=tuple(
                Quantity(f"{figure.name}_{figure.unit}", figure.value, figure.sd)
                for figure in result.figures
            ),
            reason=result.reason,
            details=result_as_dict(result),
            **context,
        )
    else:
        comparison = None
        if stated.size_mm is not None and stated.height_mm is not None:
            comparison = compare(fit, Truth(fit.shape, stated.size_mm, stated.height_mm))
        record = indenter_record(
            fit,
            comparison,
            size_limit_percent=limits.size_percent,
            height_limit_percent=limits.height_percent,
            **context,
        )
    quantities = list(record.quantities)
    for row in judged:  # size first, then depth
        index = 1 if row.quantity == "height" and fit is not None else 0
        quantities[index] = replace(
            quantities[index], value=row.measured, truth=row.true, limit_percent=row.limit_percent
        )
    settings = {"model": heightmap.model, "tool": tool_as_dict(result.tool)}
    if stated.name:
        settings["indenter"] = stated.name
    return replace(
        record,
        quantities=tuple(quantities),
        verdict=verdict_of(tuple(quantities), doubtful=result.verdict != "ok"),
        settings=settings,
    )
