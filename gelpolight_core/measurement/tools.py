"""The measuring tools, and their conversion with results to plain values for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import Any, cast

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.codec import unpack
from gelpolight_core.io.reading import brief, refusing
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.feature_tools import EdgeRadius, Pit, Scratch
from gelpolight_core.measurement.indenter_tools import Ball, Cuboid, Cylinder
from gelpolight_core.measurement.outline_tools import Circle, RectangleTool
from gelpolight_core.measurement.point_tools import Angle, Distance, StepHeight
from gelpolight_core.measurement.profile_tools import ProfileAngle, ProfileStep, ProfileWidth
from gelpolight_core.measurement.tool import Tool, ToolResult, places
from gelpolight_core.plug_ins import TOOLS as PLUG_INS
from gelpolight_core.plug_ins import plug_ins

__all__ = [
    "TOOLS",
    "Angle",
    "Ball",
    "Circle",
    "Cuboid",
    "Cylinder",
    "Distance",
    "EdgeRadius",
    "Pit",
    "ProfileAngle",
    "ProfileStep",
    "ProfileWidth",
    "Rectangle",
    "RectangleTool",
    "Scratch",
    "StepHeight",
    "Tool",
    "ToolResult",
    "result_as_dict",
    "tool_as_dict",
    "tool_from_dict",
    "tools_from_json",
]

TOOLS: Mapping[str, type[Tool]] = MappingProxyType(
    plug_ins(PLUG_INS, lambda kind: kind.name and places(kind) and kind.apply)
    | {
        kind.name: kind
        for kind in (
            Distance,
            StepHeight,
            ProfileStep,
            ProfileWidth,
            ProfileAngle,
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
)
"""Every tool by its name."""
RESULT_KEYS = ("figures", "verdict", "reason")
"""Keys that a result adds to its tool."""


def tool_as_dict(tool: Tool) -> dict[str, Any]:
    """Return a tool as plain values; ``tool`` holds its name."""
    return {"tool": tool.name, **_plain(asdict(cast(Any, tool)))}


def tool_from_dict(content: Mapping[str, Any]) -> Tool:
    """Return the tool that plain values describe.

    Raises
    ------
    InputError
        If the tool is not known, a value is missing, not known, or of the wrong kind.
    """
    name = content.get("tool")
    kind = TOOLS.get(name) if isinstance(name, str) else None
    if kind is None:
        raise InputError(
            f"unknown tool '{brief(name)}'",
            "measuring tool",
            Remedy.ONE_OF.format(names=", ".join(TOOLS)),
        )
    given = {key: value for key, value in content.items() if key != "tool"}
    with refusing(
        "the values do not describe this tool ({error})",
        f"measuring tool {name}",
    ):
        return unpack(kind, _plain(given), {}, kind.name)


def tools_from_json(content: Any) -> tuple[Tool, ...]:
    """Return the tools of a file with one tool, a list of tools, or results with their tools.

    Raises
    ------
    InputError
        If there is no tool, or one of them is invalid.
    """
    if isinstance(content, Mapping):
        content = content.get("results", [content])
    if not isinstance(content, list) or not content:
        raise InputError(
            "there is no measuring tool",
            "measuring tools",
            Remedy.ONE_OF.format(names=", ".join(TOOLS)),
        )
    tools = []
    for entry in content:
        known = entry if isinstance(entry, Mapping) else {}
        tools.append(tool_from_dict({k: v for k, v in known.items() if k not in RESULT_KEYS}))
    return tuple(tools)


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
