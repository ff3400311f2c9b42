"""The measuring tools, and their results as plain values for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from types import MappingProxyType
from typing import Any, cast

from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.feature_tools import EdgeRadius, Pit, Scratch
from gelpolight_core.measurement.indenter_tools import Ball, Cuboid, Cylinder
from gelpolight_core.measurement.outline_tools import Circle, RectangleTool
from gelpolight_core.measurement.point_tools import Angle, Distance, StepHeight
from gelpolight_core.measurement.profile_tools import ProfileWidth
from gelpolight_core.measurement.tool import Tool, ToolResult, places
from gelpolight_core.plug_ins import TOOLS as PLUG_INS
from gelpolight_core.plug_ins import plug_ins

__all__ = [
    "EXTENSIONS",
    "TOOLS",
    "Angle",
    "Ball",
    "Circle",
    "Cuboid",
    "Cylinder",
    "Distance",
    "EdgeRadius",
    "Pit",
    "ProfileWidth",
    "Rectangle",
    "RectangleTool",
    "Scratch",
    "StepHeight",
    "Tool",
    "ToolResult",
    "result_as_dict",
    "tool_as_dict",
]

_OWN: dict[str, type[Tool]] = {
    kind.name: kind
    for kind in (
        Distance,
        StepHeight,
        ProfileWidth,
        Angle,
        Circle,
        RectangleTool,
        Pit,
        Scratch,
        EdgeRadius,
        Ball,
        Cylinder,
        Cuboid,
    )
}


def _is_tool(kind: Any) -> bool:
    """Return whether a package's class is a tool that clicks on the map are enough to place."""
    others = (field for field in fields(kind) if field not in places(kind))
    placed = places(kind) and all(field.default is not MISSING for field in others)
    return bool(kind.name and kind.apply and placed)


EXTENSIONS: Mapping[str, type[Tool]] = MappingProxyType(
    {name: kind for name, kind in plug_ins(PLUG_INS, _is_tool).items() if name not in _OWN}
)
"""The tools of installed packages; none replaces one of ours."""
TOOLS: Mapping[str, type[Tool]] = MappingProxyType({**EXTENSIONS, **_OWN})
"""Every tool by its name."""


def tool_as_dict(tool: Tool) -> dict[str, Any]:
    """Return a tool as plain values; ``tool`` holds its name."""
    return {"tool": tool.name, **_plain(asdict(cast(Any, tool)))}


def result_as_dict(result: ToolResult) -> dict[str, Any]:
    """Return a result as plain values: the tool, its figures, the verdict and the reason."""
    return {
        **tool_as_dict(result.tool),
        "figures": [figure.as_json() for figure in result.figures],
        "verdict": result.verdict,
        "reason": result.reason,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(part) for part in value]
    return value
