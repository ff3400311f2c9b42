"""The arguments of a measuring tool, and the tool made from them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Any, cast

from app.command_line.common import numbers, points
from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import parse_json, read_file
from gelpolight_core.measurement.outline_tools import EDGES
from gelpolight_core.measurement.tool import POINTS, places
from gelpolight_core.measurement.tools import TOOLS, Tool, tool_from_dict, tools_from_json
from gelpolight_core.translation import tr

JSON_LIMIT = 50_000_000

LEAST_POINTS = 3
"""Number of points that a tool with any number of them needs."""


def add_tool_arguments(parser: argparse.ArgumentParser, what: Any) -> None:
    """Add the tools to a group of alternatives, and their geometry to the parser."""
    what.add_argument("--tool", choices=tuple(TOOLS), metavar="NAME", help=", ".join(TOOLS))
    what.add_argument(
        "--tools", type=Path, metavar="FILE", help=tr("JSON file of tools, or of saved results")
    )
    parser.add_argument(
        "--at",
        type=numbers,
        nargs="+",
        metavar="X Y",
        default=[],
        help=tr(
            "the tool's points in mm, in the order of the clicks on the Measure page; of a tool "
            "with a rectangle, its centre"
        ),
    )
    parser.add_argument(
        "--width",
        type=float,
        metavar="MM",
        help=tr("width of a profile in mm, over which depth is averaged"),
    )
    parser.add_argument(
        "--level",
        type=float,
        metavar="MM",
        help=tr("depth in mm at which a profile's width is measured"),
    )
    parser.add_argument(
        "--range",
        type=float,
        nargs="+",
        metavar="MM",
        help=tr("one or two ranges along a profile: A B [C D]"),
    )
    parser.add_argument(
        "--size",
        type=float,
        nargs=2,
        metavar=("A", "B"),
        help=tr("sides in mm of the area of rectangle, pit and step height"),
    )
    parser.add_argument("--yaw", type=float, metavar="DEG", help=tr("rotation of rectangles"))
    parser.add_argument(
        "--edge",
        choices=EDGES,
        help=tr("measure a circle or rectangle at the steepest edge nearby, or as it was placed"),
    )


def chosen_tools(options: argparse.Namespace) -> tuple[Tool, ...]:
    """Return the tools of the arguments. None with ``--shape``.

    Raises
    ------
    InputError
        If something is missing or does not belong to the tool.
    """
    if options.tools is not None:
        _refuse_rest(options, set(), "--tools")
        return tools_from_json(_read(options.tools))
    if options.tool is None:
        _refuse_rest(options, {"seed"}, "--shape")
        return ()
    return (tool_from_dict({"tool": options.tool, **_geometry(options)}),)


def _geometry(options: argparse.Namespace) -> dict[str, Any]:
    """Return the tool's geometry in the form of :func:`tool_from_dict`, by the fields of the tool.

    ``--at`` fills its places in their order; each option fills the field with its name.
    """
    name, kind = options.tool, TOOLS[options.tool]
    types = {field.name: str(field.type) for field in fields(cast(Any, kind))}
    ranges = [field for field in fields(cast(Any, kind)) if str(field.type).startswith("Range")]
    rectangles = "Rectangle" in types.values()
    plain = {"width": "width_mm", "level": "level_mm", "edge": "edge"}
    allowed = {option for option, field in plain.items() if field in types}
    allowed |= {"size", "yaw"} if rectangles else set()
    allowed |= {"range"} if ranges else set()
    placed = _placed(options)
    _refuse_rest(options, {"at", *allowed}, name)
    if POINTS in types.values():
        content: dict[str, Any] = {places(kind)[0].name: placed}
    else:
        content = {
            field.name: _rectangle(options, at) if types[field.name] == "Rectangle" else at
            for field, at in zip(places(kind), placed, strict=False)
        }
    given = {field: getattr(options, option) for option, field in plain.items() if field in types}
    return content | _given(**given) | _ranges(options, ranges)


def _placed(options: argparse.Namespace) -> list[tuple[float, float]]:
    """Return the points of the tool, as many as it has places."""
    placed = points(options.at, where="--at") if options.at else []
    kinds = [str(field.type) for field in places(TOOLS[options.tool])]
    least = LEAST_POINTS if POINTS in kinds else sum("None" not in kind for kind in kinds)
    most = None if POINTS in kinds else len(kinds)
    if len(placed) < least or (most is not None and len(placed) > most):
        raise InputError(
            tr("Number of points: {n}").format(n=len(placed)),
            where=tr("Measuring tool {name}").format(name=options.tool),
            advice=tr("It needs {least}: --at X Y ...").format(
                least=least if most == least else tr("{n} or more").format(n=least)
            ),
        )
    return placed


def _rectangle(options: argparse.Namespace, centre_mm: tuple[float, float]) -> dict[str, Any]:
    if options.size is None:
        raise InputError(
            tr("The size is missing"),
            where=tr("Measuring tool {name}").format(name=options.tool),
            advice=tr("Give it with --size A B, in mm"),
        )
    return {"centre_mm": centre_mm, "sides_mm": options.size, **_given(yaw_deg=options.yaw)}


def _ranges(options: argparse.Namespace, wanted: Sequence[Field[Any]]) -> dict[str, Any]:
    """Return the ranges along a profile."""
    given = options.range or []
    if not given and all(field.default is not MISSING for field in wanted):
        return {}
    if len(given) != 2 * len(wanted):
        raise InputError(
            tr("Number of values: {n}").format(n=len(given)),
            where="--range",
            advice=tr("The tool {name} needs {n}").format(name=options.tool, n=2 * len(wanted)),
        )
    return {field.name: given[2 * k : 2 * k + 2] for k, field in enumerate(wanted)}


def _given(**values: Any) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _refuse_rest(options: argparse.Namespace, allowed: set[str], name: str) -> None:
    """Raise an error for an argument that would be ignored."""
    for key in ("at", "width", "level", "range", "size", "yaw", "edge", "seed"):
        if getattr(options, key) not in (None, []) and key not in allowed:
            raise InputError(
                tr("This option cannot be used with {name}").format(name=name),
                where=f"--{key}",
                advice=tr("Remove the option"),
            )


def _read(path: Path) -> Any:
    """Read a JSON file."""
    try:
        return parse_json(read_file(path, JSON_LIMIT))
    except (FileNotFoundError, ValueError) as error:
        raise InputError(
            tr("The file cannot be read as JSON"),
            where=str(path),
            advice=tr("Give a file of tools, as written by measure --json"),
        ) from error
