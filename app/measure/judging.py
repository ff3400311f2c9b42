"""Measured and true values: errors, limits, and the record of a result. Without Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from app.services.preferences import Limits
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.measurement.result import Quantity, Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict, tool_as_dict
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.records.entry import MeasurementRecord, indenter_record, verdict_of
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

    def truth(self, shape: str) -> Truth:
        """Return the true sizes of an indenter."""
        known = (math.nan if x is None else x for x in (self.size_mm, self.height_mm))
        return Truth(shape, *known)


def judge(result: ToolResult, stated: Stated, limits: Limits) -> tuple[Quantity, ...]:
    """Compare a result with its true values.

    Returns
    -------
    tuple of Quantity
        Those with a true value: size and height of an indenter, the first figure of another tool.

    Raises
    ------
    InputError
        If a given length is not greater than zero.
    """
    if result.measurement is not None:
        truth = stated.truth(result.measurement.shape)
        both = compare(result.measurement, truth, limits.percent)
        return tuple(quantity for quantity in both if quantity.truth is not None)
    true = stated.size_mm
    if true is None:
        return ()
    if not (math.isfinite(true) and true > 0.0):
        raise InputError(
            tr("The true value is {value}").format(value=true),
            where=tr("True value"),
            advice=tr("Enter a value greater than zero"),
        )
    figure = result.figures[0]
    in_depth = figure.name in DEPTH_FIGURES
    # The sign of a step only depends on the order of the clicks.
    value = abs(figure.value) if in_depth else figure.value
    limit = limits.percent[in_depth]
    return (replace(_quantity(figure), value=value, truth=true, limit_percent=limit),)


def _quantity(figure: Measured) -> Quantity:
    return Quantity(f"{figure.name}_{figure.unit}", figure.value, figure.sd)


def record_of(
    result: ToolResult,
    judged: tuple[Quantity, ...],
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
    judged : tuple of Quantity
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
    settings = {"model": heightmap.model, "tool": tool_as_dict(result.tool)}
    if stated.name:
        settings["indenter"] = stated.name
    context: dict[str, Any] = {
        "serial": serial,
        "calibration_id": heightmap.calibration_id,
        "operator": operator,
        "picture": heightmap.source,
        "note": note,
        "settings": settings,
    }
    fit, doubtful = result.measurement, result.verdict != "ok"
    if fit is not None:
        truth = stated.truth(fit.shape)
        record = indenter_record(fit, truth, limits_percent=limits.percent, **context)
        return replace(record, verdict=verdict_of(record.quantities, doubtful=doubtful))
    quantities = (*judged, *map(_quantity, result.figures[len(judged) :]))
    return MeasurementRecord(
        shape=result.tool.name.replace("-", "_"),
        quantities=quantities,
        verdict=verdict_of(quantities, doubtful=doubtful),
        reason=result.reason,
        details=result_as_dict(result),
        **context,
    )
