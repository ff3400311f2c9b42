"""The arguments of a measuring tool, and the tool made from them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import numbers, points
from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import parse_json, read_file
from gelpolight_core.measurement.outline_tools import EDGES
from gelpolight_core.measurement.tools import TOOLS, Tool, tool_from_dict, tools_from_json
from gelpolight_core.translation import tr

JSON_LIMIT = 50_000_000

# Number of points of each tool. None: no upper limit.
POINT_COUNTS: dict[str, tuple[int, int | None]] = {
    "distance": (2, 2),
    "step-height": (2, 2),
    "profile-step": (2, 2),
    "profile-width": (2, 2),
    "profile-angle": (2, 2),
    "angle": (3, 3),
    "circle": (3, None),
    "rectangle": (1, 1),
    "pit": (1, 1),
    "scratch": (2, 2),
    "edge-radius": (2, 2),
    "ball": (0, 1),
    "cylinder": (0, 1),
    "cuboid": (0, 1),
}


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
        help=tr("the tool's points in mm: ends, centres, apex and arms, or points of a rim"),
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
        "--size", type=float, nargs=2, metavar=("A", "B"), help=tr("sides of rectangles in mm")
    )
    parser.add_argument("--yaw", type=float, metavar="DEG", help=tr("rotation of rectangles"))
    parser.add_argument(
        "--edge", choices=EDGES, help=tr("depth in mm at which a circle or rectangle is measured")
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
    """Return the tool's geometry in the form of :func:`tool_from_dict`."""
    name = options.tool
    placed = points(options.at, where="--at") if options.at else []
    least, most = POINT_COUNTS[name]
    if len(placed) < least or (most is not None and len(placed) > most):
        raise InputError(
            tr("Number of points: {n}").format(n=len(placed)),
            where=tr("Measuring tool {name}").format(name=name),
            advice=tr("It needs {least}: --at X Y ...").format(
                least=least if most == least else tr("{n} or more").format(n=least)
            ),
        )
    if name in ("step-height", "rectangle", "pit"):
        allowed = {"at", "size", "yaw"} | ({"edge"} if name == "rectangle" else set())
        _refuse_rest(options, allowed, name)
        areas = [_rectangle(options, point) for point in placed]
        keys = ("first", "second") if name == "step-height" else ("rectangle",)
        return dict(zip(keys, areas, strict=True)) | _given(edge=options.edge)
    if name.startswith("profile-"):
        allowed = {"at", "width", "range"} | ({"level"} if name == "profile-width" else set())
        _refuse_rest(options, allowed, name)
        ends = {"start_mm": placed[0], "end_mm": placed[1]}
        return ends | _given(width_mm=options.width, level_mm=options.level) | _ranges(options)
    if name in ("scratch", "edge-radius"):
        _refuse_rest(options, {"at", "width"}, name)
        return {"start_mm": placed[0], "end_mm": placed[1]} | _given(width_mm=options.width)
    _refuse_rest(options, {"at"} | ({"edge"} if name == "circle" else set()), name)
    if name == "circle":
        return {"points_mm": placed} | _given(edge=options.edge)
    keys = {"distance": ("a_mm", "b_mm"), "angle": ("apex_mm", "first_mm", "second_mm")}.get(
        name, ("at_mm",)
    )
    return dict(zip(keys, placed, strict=False))


def _rectangle(options: argparse.Namespace, centre_mm: tuple[float, float]) -> dict[str, Any]:
    if options.size is None:
        raise InputError(
            tr("The size is missing"),
            where=tr("Measuring tool {name}").format(name=options.tool),
            advice=tr("Give it with --size A B, in mm"),
        )
    return {"centre_mm": centre_mm, "sides_mm": options.size, **_given(yaw_deg=options.yaw)}


def _ranges(options: argparse.Namespace) -> dict[str, Any]:
    """Return the ranges along a profile."""
    given = options.range or []
    keys = ("between_mm",) if options.tool == "profile-width" else ("first_mm", "second_mm")
    if options.tool == "profile-width" and not given:
        return {}
    if len(given) != 2 * len(keys):
        raise InputError(
            tr("Number of values: {n}").format(n=len(given)),
            where="--range",
            advice=tr("The tool {name} needs {n}").format(name=options.tool, n=2 * len(keys)),
        )
    return {key: given[2 * k : 2 * k + 2] for k, key in enumerate(keys)}


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
