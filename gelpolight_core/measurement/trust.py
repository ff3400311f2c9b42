"""Mark measurements as doubtful if the calibration or the image has a fault."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.tool import ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.in_place.calibration import MODEL as IN_PLACE
from gelpolight_core.translation import joined, tr

Result = TypeVar("Result", Measurement, ToolResult)

WALLED = ("cylinder", "cuboid")
"""Shapes whose walls are steeper than a ball and narrower than the smoothing of an image."""


def judged(result: Result, height_map: HeightMap) -> Result:
    """Return a measurement that is never better than the height map behind it.

    Every measurement goes through this function: in the public interface, on the command line, on
    the Measure page, in an evaluation, in a protocol and in a batch.

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
    faults: list[str] = [finding.text for finding in height_map.doubts]
    if isinstance(result, Measurement) and result.shape in WALLED and height_map.model == IN_PLACE:
        faults.append(
            tr(
                "the balls of this in-place calibration have no walls: on the virtual sensor, "
                "heights are 7 to 10 % too small and sizes 2 to 11 % too large"
            )
        )
    if not faults:
        return result
    reason = joined("; ", (text for text in (*faults, result.reason) if text))
    doubtful = replace(result, verdict="doubtful", reason=reason)
    if isinstance(doubtful, ToolResult) and doubtful.measurement is not None:
        doubtful = replace(doubtful, measurement=judged(doubtful.measurement, height_map))
    return doubtful
