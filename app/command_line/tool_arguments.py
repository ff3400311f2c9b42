"""The arguments of a measuring tool, and the tool made from them."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from app.command_line.options import Command, option, separated_values
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import parse_json, read_file
from gelpolight_core.measurement.indenter_tools import AUTO
from gelpolight_core.measurement.measure import SHAPES
from gelpolight_core.measurement.tool import POINTS, places
from gelpolight_core.measurement.tools import TOOLS, Tool, tool_from_dict, tools_from_json
from gelpolight_core.number import read_number


@dataclass(frozen=True)
class ToolArguments(Command):
    """What is measured: the pressed object, or what a measuring tool finds."""

    shape: str | None = option(one_of=True, choices=(*SHAPES, AUTO))
    tool: Path | None = option(
        "one of {names}; or a JSON file of tools, or of saved results".format(
            names=", ".join(TOOLS)
        ),
        one_of=True,
        metavar="NAME",
    )
    at: list[str] = option(
        (
            "the tool's points in mm, in the order of the clicks on the Measure page; of a tool "
            "with a rectangle, its centre; with --shape, a point on the object to measure, where "
            "several are pressed"
        ),
        metavar="X Y",
        default=[],
    )
    size: list[str] = option(
        (
            "sides A B in mm of the area of rectangle, pit and step height; a third number is its "
            "rotation in degrees"
        ),
        metavar="MM",
        default=[],
    )
    set: list[str] = option(
        (
            "other values of the tool, named as in its JSON: width_mm=0.4, level_mm=0.2, "
            "first_mm=1,2, edge=placed"
        ),
        metavar="KEY=VALUE",
        default=[],
    )

    def tools(self) -> tuple[Tool, ...]:
        """Return the tools. None with ``--shape``.

        Raises
        ------
        InputError
            If something is missing or does not belong to the tool.
        """
        if self.tool is None:
            self._refuse("size", "set")
            return ()
        if str(self.tool) in TOOLS:
            return (tool_from_dict({"tool": str(self.tool), **self._geometry(str(self.tool))}),)
        self._refuse("at", "size", "set")
        return tools_from_json(read_tools(self.tool))

    def seed(self) -> tuple[float, float] | None:
        """Return the point on the object to measure, if one is given."""
        points = self._points((2,))
        if len(points) > 1:
            raise InputError(
                f"Number of points: {len(points)} instead of one",
                "--at",
                Remedy.CORRECT_VALUE,
            )
        return points[0] if points else None

    def _points(self, counts: Container[int]) -> list[tuple[float, float]]:
        """Return the points, of so many numbers."""
        numbers = separated_values(self.at, counts, "--at")
        if len(numbers) % 2:
            raise InputError(
                f"Number of values: {len(numbers)}, but each point needs two",
                "--at",
                Remedy.CORRECT_VALUE,
            )
        return list(zip(numbers[::2], numbers[1::2], strict=True))

    def _geometry(self, tool: str) -> dict[str, Any]:
        """Return the tool's geometry in the form of :func:`tool_from_dict`."""
        types = {field.name: str(field.type) for field in places(TOOLS[tool])}
        where = f"Measuring tool {tool}"
        several = POINTS in types.values()
        points = self._points(range(6, 10_000, 2) if several else (2 * len(types),))
        size = separated_values(self.size, (2, 3), "--size")
        if several:
            content: dict[str, Any] = dict.fromkeys(types, points)
        else:
            if len(points) > len(types):
                raise InputError(
                    f"Number of points: {len(points)} instead of {len(types)}",
                    where,
                    Remedy.STATE_WITH.format(option="--at X Y ..."),
                )
            content = dict(zip(types, points, strict=False))
        if "Rectangle" not in types.values():
            self._refuse("size")
        elif len(size) not in (2, 3):
            raise InputError(
                "The size in mm is missing",
                where,
                Remedy.STATE_WITH.format(option="--size A B"),
            )
        for name in content:
            if types[name] == "Rectangle":
                a, b, yaw = (*size, 0.0)[:3]
                content[name] = {"centre_mm": content[name], "sides_mm": (a, b), "yaw_deg": yaw}
        kinds = {f.name: str(f.type) for f in fields(TOOLS[tool])}  # type: ignore[arg-type]
        for text in self.set:
            key, _, value = text.partition("=")
            content[key] = _value(value, kinds.get(key, ""), f"--set {key}")
        return content

    def _refuse(self, *names: str) -> None:
        """Raise an error for an option that would be ignored."""
        for name in names:
            if getattr(self, name) not in (None, []):
                raise InputError(
                    "This option cannot be used with {name}".format(name=self.tool or "--shape"),
                    f"--{name.replace('_', '-')}",
                    Remedy.REMOVE_OPTION,
                )


def _value(text: str, kind: str, where: str) -> Any:
    """Return the number of a field of numbers; of another one several numbers, or a word."""
    if "float" in kind:
        return read_number(text, where)
    try:
        return [read_number(part, where) for part in text.split(",")]
    except InputError:
        return text


def read_tools(path: Path) -> Any:
    """Read a JSON file."""
    try:
        return parse_json(read_file(path, 50_000_000))
    except (FileNotFoundError, ValueError) as error:
        raise InputError(
            "This is neither a measuring tool nor a JSON file",
            f"--tool {path}",
            Remedy.ONE_OF.format(names=", ".join(TOOLS)),
        ) from error
