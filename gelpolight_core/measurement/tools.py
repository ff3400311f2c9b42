"""The measuring tools, and their conversion with results to plain values for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, asdict, fields
from types import MappingProxyType
from typing import Any, cast

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import brief
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.feature_tools import EdgeRadius, Pit, Scratch
from gelpolight_core.measurement.indenter_tools import Ball, Cuboid, Cylinder
from gelpolight_core.measurement.outline_tools import EDGES, Circle, RectangleTool
from gelpolight_core.measurement.point_tools import Angle, Distance, StepHeight
from gelpolight_core.measurement.profile_tools import ProfileAngle, ProfileStep, ProfileWidth
from gelpolight_core.measurement.tool import Tool, ToolResult
from gelpolight_core.translation import tr

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
    {
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
            tr("unknown tool '{name}'").format(name=brief(name)),
            where=tr("measuring tool"),
            advice=Remedy.ONE_OF.format(names=", ".join(TOOLS)),
        )
    known = {field.name: field for field in fields(cast(Any, kind))}
    given = {key: value for key, value in content.items() if key != "tool"}
    wrong = sorted(set(given) - set(known))
    needed = {key for key, field in known.items() if field.default is MISSING}
    missing = sorted(needed - set(given))
    if wrong or missing:
        raise InputError(
            tr("{key} is missing or not one of {names}").format(
                key=brief([*missing, *wrong][0]), names=", ".join(known)
            ),
            where=tr("measuring tool {name}").format(name=name),
            advice=Remedy.CORRECT_ENTRY,
        )
    values = {key: _value(known[key], value, name) for key, value in given.items()}
    return kind(**values)


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
            tr("there is no measuring tool"),
            where=tr("measuring tools"),
            advice=Remedy.ONE_OF.format(names=", ".join(TOOLS)),
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


def _value(field: Field[Any], value: Any, tool: Any) -> Any:
    """Return a value of the type in the annotation of a field."""
    kind = str(field.type)
    try:
        if value is None and "None" in kind:
            return None
        if kind == "Rectangle":
            return Rectangle(
                _point(value["centre_mm"]),
                _point(value["sides_mm"]),
                _number(value.get("yaw_deg", 0.0)),
            )
        if kind == "Edge":
            if value not in EDGES:
                raise ValueError("no such edge")
            return value
        if kind.startswith("tuple"):
            return tuple(_point(part) for part in value)
        return _point(value) if kind.startswith(("Point", "Range")) else _number(value)
    except (TypeError, ValueError, KeyError, AttributeError, ArithmeticError) as error:
        raise InputError(
            tr("{key} is {value}, not a length in mm or a position of two numbers").format(
                key=field.name, value=brief(value)
            ),
            where=tr("measuring tool {name}").format(name=tool),
            advice=Remedy.CORRECT_VALUE,
        ) from error


def _point(value: Any) -> tuple[float, float]:
    x, y = value
    return _number(x), _number(y)


def _number(value: Any) -> float:
    if isinstance(value, (bool, str)):
        raise ValueError("it is no number")
    number = float(value)
    if not abs(number) < 1e6:
        raise ValueError("it is no length")
    return number
