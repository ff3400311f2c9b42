"""Mark measurements as doubtful if the calibration or the image has a fault."""

from __future__ import annotations

from typing import TypeVar

from gelpolight_core.base.finding import Finding, doubtful_finding
from gelpolight_core.measurement.tools.tool_base import ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.sensor.closed_sensor.closed_sensor_data import MODEL as IN_PLACE
from gelpolight_core.session.reference_object import WALLED

from .result import Measurement

MeasuredT = TypeVar("MeasuredT", Measurement, ToolResult)


def with_map_findings(result: MeasuredT, height_map: HeightMap) -> MeasuredT:
    """Return a measurement that is never better than the height map behind it.

    Every measurement goes through this function: in the public interface, on the command line, on
    the Measure page, in an evaluation, in a validation and in a batch.

    Parameters
    ----------
    result : Measurement or ToolResult
        Its verdict is based on the depths alone.
    height_map : HeightMap
        The measured height map.

    Returns
    -------
    Measurement or ToolResult
        Doubtful, with the reason, if the height map has faults, or a shape with walls was measured
        with an in-place calibration; unchanged otherwise.
    """
    faults: tuple[Finding, ...] = height_map.doubtful_findings
    if result.shape in WALLED and height_map.model == IN_PLACE:
        text = (
            "the balls of this in-place calibration have no walls: on the virtual sensor, "
            "heights are 7 to 10 % too small and sizes 2 to 11 % too large"
        )
        faults = (*faults, doubtful_finding("walls", text))
    return result.with_findings(faults)
