"""The arguments of a measuring tool, and the tool made from them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import numbers, points
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import parse_json, read_file
from gelpolight_core.measurement.tool import POINTS, places
from gelpolight_core.measurement.tools import TOOLS, Tool, tool_from_dict, tools_from_json
from gelpolight_core.translation import tr


def add_tool_arguments(parser: argparse.ArgumentParser, what: Any) -> None:
    """Add the tool to a group of alternatives, and its geometry to the parser."""
    what.add_argument(
        "--tool",
        metavar="NAME",
        help=tr("one of {names}; or a JSON file of tools, or of saved results").format(
            names=", ".join(TOOLS)
        ),
    )
    parser.add_argument(
        "--at",
        type=numbers,
        nargs="+",
        metavar="X Y",
        default=[],
        help=tr(
            "the tool's points in mm, in the order of the clicks on the Measure page; of a tool "
            "with a rectangle, its centre; with --shape, a point on the object to measure, where "
            "several are pressed"
        ),
    )
    parser.add_argument(
        "--size",
        type=float,
        nargs="+",
        metavar="MM",
        default=[],
        help=tr(
            "sides A B in mm of the area of rectangle, pit and step height; a third number is its "
            "rotation in degrees"
        ),
    )
    parser.add_argument(
        "--set",
        nargs="+",
        metavar="KEY=VALUE",
        default=[],
        help=tr(
            "other values of the tool, named as in its JSON: width_mm=0.4, level_mm=0.2, "
            "first_mm=1,2, edge=placed"
        ),
    )


def chosen_tools(options: argparse.Namespace) -> tuple[Tool, ...]:
    """Return the tools of the arguments. None with ``--shape``.

    Raises
    ------
    InputError
        If something is missing or does not belong to the tool.
    """
    if options.tool in TOOLS:
        return (tool_from_dict({"tool": options.tool, **_geometry(options)}),)
    if options.tool is not None:
        _refuse_options(options, "at", "size", "set")
        return tools_from_json(_read(Path(options.tool)))
    _refuse_options(options, "size", "set")
    return ()


def _geometry(options: argparse.Namespace) -> dict[str, Any]:
    """Return the tool's geometry in the form of :func:`tool_from_dict`."""
    types = {field.name: str(field.type) for field in places(TOOLS[options.tool])}
    placed = points(options.at, where="--at") if options.at else []
    if POINTS in types.values():
        content: dict[str, Any] = dict.fromkeys(types, placed)
    else:
        if len(placed) > len(types):
            raise InputError(
                tr("Number of points: {n} instead of {least}").format(
                    n=len(placed), least=len(types)
                ),
                where=tr("Measuring tool {name}").format(name=options.tool),
                advice=Remedy.STATE_WITH.format(option="--at X Y ..."),
            )
        content = dict(zip(types, placed, strict=False))
    if "Rectangle" not in types.values():
        _refuse_options(options, "size")
    elif len(options.size) not in (2, 3):
        raise InputError(
            tr("The size in mm is missing"),
            where=tr("Measuring tool {name}").format(name=options.tool),
            advice=Remedy.STATE_WITH.format(option="--size A B"),
        )
    for name in content:
        if types[name] == "Rectangle":
            a, b, yaw = (*options.size, 0.0)[:3]
            content[name] = {"centre_mm": content[name], "sides_mm": (a, b), "yaw_deg": yaw}
    for text in options.set:
        key, _, value = text.partition("=")
        content[key] = _value(value)
    return content


def _value(text: str) -> Any:
    """Return a number, several numbers, or a word."""
    try:
        found = numbers(text)
    except ValueError:
        return text
    return found[0] if len(found) == 1 else found


def _refuse_options(options: argparse.Namespace, *names: str) -> None:
    """Raise an error for an option that would be ignored."""
    for name in names:
        if getattr(options, name):
            raise InputError(
                tr("This option cannot be used with {name}").format(name=options.tool or "--shape"),
                where=f"--{name}",
                advice=Remedy.REMOVE_OPTION,
            )


def _read(path: Path) -> Any:
    """Read a JSON file."""
    try:
        return parse_json(read_file(path, 50_000_000))
    except (FileNotFoundError, ValueError) as error:
        raise InputError(
            tr("This is neither a measuring tool nor a JSON file"),
            where=f"--tool {path}",
            advice=Remedy.ONE_OF.format(names=", ".join(TOOLS)),
        ) from error
