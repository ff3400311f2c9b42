"""Measured values beside their references, and the record of a result. Without Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from app.services.preferences import Limits
from app.widgets.fields import number
from gelpolight_core.measurement.result import Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict, tool_as_dict
from gelpolight_core.quantity import Quantity
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.records.entry import MeasurementRecord, verdict_of
from gelpolight_core.translation import tr

DEPTH_FIGURES = frozenset({"step_height", "height", "depth_difference", "mean_depth", "deepest"})
LARGEST = 500.0


@dataclass(frozen=True, slots=True)
class Reference:
    """The true values of an object, as the user states them. 0: not known.

    Attributes
    ----------
    size_mm : float
        The diameter, the mean side, or the tool's first figure in its own unit.
    height_mm : float
        Indentation depth.
    name : str
        Name of the known object. Empty if the numbers were typed.
    """

    size_mm: float = number(
        0.0, tr("Size"), 0.0, LARGEST, tr(" mm"), 3, step=0.1, none=tr("not known")
    )
    height_mm: float = number(
        0.0, tr("Depth"), 0.0, LARGEST, tr(" mm"), 3, step=0.1, none=tr("not known")
    )
    name: str = ""

    def truth(self, shape: str) -> Truth:
        """Return it as the true size of a shape."""
        return Truth(shape, self.size_mm or math.nan, self.height_mm or math.nan)


def quantities_of(result: ToolResult, reference: Reference, limits: Limits) -> tuple[Quantity, ...]:
    """Return the measured values of a result, with their true values where they are known."""
    fit = result.measurement
    if fit is not None:
        return compare(fit, reference.truth(fit.shape), limits.percent)
    first, *others = (Quantity(f"{f.name}_{f.unit}", f.value, f.sd) for f in result.figures)
    if not reference.size_mm:
        return (first, *others)
    # The sign of a step only depends on the order of the clicks.
    in_depth = result.figures[0].name in DEPTH_FIGURES
    value = abs(first.value) if in_depth else first.value
    limit = limits.percent[in_depth]
    return (replace(first, value=value, truth=reference.size_mm, limit_percent=limit), *others)


def record_of(
    result: ToolResult,
    reference: Reference,
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
    reference : Reference
        The true values.
    heightmap : HeightMap
        The height map that was measured.
    limits : Limits
        Limits of the verdict.
    serial : str
        The sensor.
    operator, note : str
        Operator, and their note.
    """
    fit, quantities = result.measurement, quantities_of(result, reference, limits)
    if fit is None:
        shape, details = result.tool.name.replace("-", "_"), result_as_dict(result)
    else:
        shape, details = fit.shape, fit.as_json(reference.truth(fit.shape))
    settings = {"model": heightmap.model, "tool": tool_as_dict(result.tool)}
    if reference.name:
        settings["indenter"] = reference.name
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
