"""``gelpolight measure``: how large the pressed object is."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import (
    add_model,
    load_reconstructor,
    read_frame,
    refuse_overwriting,
    write_json,
)
from app.command_line.terminal import say
from app.command_line.tool_arguments import add_tool_arguments, chosen_tools
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.measurement.indenter_tools import measure_heightmap
from gelpolight_core.measurement.measure import SHAPES
from gelpolight_core.measurement.proposal import propose
from gelpolight_core.measurement.result import Comparison, Measurement, Truth, compare
from gelpolight_core.measurement.tools import ToolResult, result_as_dict
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.translation import tr

AUTO = "auto"


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "measure", help=tr("say how large the pressed object is, or apply a measuring tool")
    )
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--shape", choices=(*SHAPES, AUTO))
    add_tool_arguments(parser, what)
    parser.add_argument(
        "--truth", type=Path, metavar="FILE", help=tr("truth.csv with this picture; with --shape")
    )
    parser.add_argument(
        "--seed",
        type=float,
        nargs=2,
        metavar=("X", "Y"),
        help=tr("a point (mm) on the object to measure, where several are pressed; with --shape"),
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct the picture, fit the object or apply the tools, and print what they say."""
    if options.json:
        used = [options.calibration, options.image, options.truth, options.tools]
        refuse_overwriting([options.json], filter(None, used))
        refuse_unwritable(options.json)
    tools = chosen_tools(options)
    truth = _truth(options)
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    frame = read_frame(options.image, reconstructor)
    heightmap = reconstructor.depth(frame, name=options.image.name, normals=False, uncertainty=True)
    if tools:
        results = [tool.apply(heightmap) for tool in tools]
        content: dict[str, Any] = {
            "image": heightmap.source,
            "calibration_id": heightmap.calibration_id,
            "model": heightmap.model,
            "results": [result_as_dict(result) for result in results],
        }
        lines = [line for result in results for line in tool_lines(result)]
    else:
        seed = tuple(options.seed) if options.seed else None
        shape = options.shape if options.shape != AUTO else _proposed(heightmap, seed, options)
        measurement = measure_heightmap(heightmap, shape=shape, seed_mm=seed)
        comparison = None if truth is None else compare(measurement, truth)
        content = measurement.as_json(comparison)
        lines = measurement_lines(measurement, comparison)
        if options.shape == AUTO:
            lines = [f"{tr('shape'):<12} {shape}", *lines]
    if options.json:
        write_json(content, options.json)
    say("\n".join(lines))
    return 0


def _truth(options: argparse.Namespace) -> Truth | None:
    """Return the true sizes of the picture's object, where a file with them is named."""
    if options.truth is None:
        return None
    if options.shape is None:
        raise InputError(
            tr("a tool has no true sizes to compare with"),
            where="--truth",
            advice=tr("Use it with --shape"),
        )
    rows = {row.file: row.truth for row in read_truth(options.truth).rows}
    if options.image.name not in rows:
        raise InputError(
            tr("there is no row for {name}").format(name=options.image.name),
            where=str(options.truth),
            advice=tr("Add the picture with its shape and true sizes"),
        )
    return rows[options.image.name]


def _proposed(
    heightmap: HeightMap, seed_mm: tuple[float, float] | None, options: argparse.Namespace
) -> str:
    """Return the shape that is pressed."""
    proposal = propose(heightmap, seed_mm=seed_mm)
    if proposal is not None and proposal.shape in SHAPES:
        return proposal.shape
    found = (
        tr("nothing that looks like a ball, a cylinder or a cuboid is pressed")
        if proposal is None
        else tr("it may be a {first} or a {second}").format(
            first=proposal.candidates[0], second=proposal.candidates[1]
        )
    )
    raise InputError(
        found, where=str(options.image), advice=tr("Say what it is with --shape, or use --tool")
    )


def tool_lines(result: ToolResult) -> list[str]:
    """Return a tool's result as lines of text, each value with its standard deviation."""
    lines = [f"{result.tool.name}:"]
    for figure in result.figures:
        line = f"  {figure.label:<26} {figure.value:.4f} {figure.unit}"
        lines.append(line + ("" if figure.sd is None else f"  (sd {figure.sd:.4f})"))
    verdict = result.verdict + (f": {result.reason}" if result.reason else "")
    return [*lines, f"  {tr('verdict'):<26} {verdict}"]


def measurement_lines(measurement: Measurement, comparison: Comparison | None) -> list[str]:
    """Return a measurement as lines of text, each value with its standard deviation."""
    values = measurement.as_json(comparison)
    errors = values["error_percent"] or {}
    rows = (
        ("diameter_mm", tr("diameter"), "mm"),
        ("side_mm", tr("sides"), "mm"),
        ("height_mm", tr("height"), "mm"),
        ("centre_mm", tr("centre"), "mm"),
        ("yaw_deg", tr("yaw"), "deg"),
        ("drape_decay_mm", tr("drape decay"), "mm"),
    )
    lines = []
    for key, label, unit in rows:
        if values.get(key) is None:
            continue
        sd = values["sd"].get(key)
        line = f"{label:<12} {_numbers(values[key])} {unit}"
        if sd is not None:
            line += f"  (sd {_numbers(sd)})"
            parts = [
                f"{name} {_numbers(values[part][key])}"
                for part, name in (
                    ("noise_sd", tr("noise")),
                    ("calibration_sd", tr("calibration")),
                )
                if values[part] is not None
            ]
            line = line[:-1] + "".join(f", {part}" for part in parts) + ")"
        if key in errors:
            line += tr("  error {e:+.2f} %").format(e=errors[key])
        lines.append(line)
    verdict = measurement.verdict + (f": {measurement.reason}" if measurement.reason else "")
    return [*lines, f"{tr('verdict'):<12} {verdict}"]


def _numbers(value: Any) -> str:
    return ", ".join(f"{v:.4f}" for v in (value if isinstance(value, list) else [value]))
