"""Mark measurements as doubtful if the calibration or the image has a fault."""

from __future__ import annotations

from typing import TypeVar

from gelpolight_core.measurement.tools.tool_base import ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap

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
        Doubtful, with the reason, if the height map has faults; unchanged otherwise.
    """
    return result.with_findings(height_map.doubtful_findings)
