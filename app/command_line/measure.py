"""``gelpolight measure``: the sizes of pressed objects."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from app.command_line.common import check_outputs, one_point
from app.command_line.parser import MENDABLE
from app.command_line.reconstructing import (
    add_despite_faults,
    add_model,
    load_reconstructor,
    read_frame,
)
from app.command_line.terminal import say
from app.command_line.tool_arguments import add_tool_arguments, chosen_tools
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import write_json
from gelpolight_core.light.finding import as_dict
from gelpolight_core.measurement.indenter_tools import AUTO, measure_heightmap
from gelpolight_core.measurement.measurable import measurable_depth
from gelpolight_core.measurement.measure import SHAPES
from gelpolight_core.measurement.press import read_truth
from gelpolight_core.measurement.result import Truth
from gelpolight_core.measurement.tools import Tool, ToolResult, result_as_dict
from gelpolight_core.measurement.trust import judged
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("images", type=Path, nargs="+", metavar="IMAGE")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--shape", choices=(*SHAPES, AUTO))
    add_tool_arguments(parser, what)
    parser.add_argument(
        "--truth", type=Path, metavar="FILE", help=tr("truth.csv with these images; with --shape")
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    add_despite_faults(parser)
    add_model(parser)


def run(options: argparse.Namespace) -> int:
    """Measure each image and print the results.

    An image that cannot be measured is reported, and the other images are measured.
    """
    tools = chosen_tools(options)
    used = [options.calibration, *options.images, options.truth]
    check_outputs([options.json], [*used, options.tool and Path(options.tool)])
    truths = _truths(options)
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    several = len(options.images) > 1
    entries, refused = [], 0
    for image in options.images:
        try:
            entry, lines = _measured(image, reconstructor, tools, truths.get(image.name), options)
        except InputError as error:
            if not several:
                raise
            refused += 1
            named = str(error) if str(image) in str(error) else f"{image}: {error}"
            say(f"gelpolight: {named}", file=sys.stderr)
            entries.append({"image": image.name, "error": str(error)})
            continue
        entries.append({"image": image.name} | entry if several else entry)
        say("\n".join([f"{image}:", *(f"  {line}" for line in lines)] if several else lines))
    if options.json:
        write_json(options.json, entries if several else entries[0])
    return MENDABLE if refused else 0


def _measured(
    image: Path,
    reconstructor: Reconstructor,
    tools: Sequence[Tool],
    truth: Truth | None,
    options: argparse.Namespace,
) -> tuple[dict[str, Any], list[str]]:
    """Reconstruct an image and fit the object or apply the tools. Return JSON values and text."""
    frame = read_frame(image, reconstructor)
    heightmap = measurable_depth(
        reconstructor,
        frame,
        name=image.name,
        where=str(image),
        despite_faults=options.despite_faults,
    )
    findings = () if heightmap.health is None else heightmap.health.findings
    faults = {"faults": [as_dict(finding) for finding in findings]}
    corrected = [finding.line for finding in findings if not finding.doubtful]
    if tools:
        results = [judged(tool.apply(heightmap), heightmap) for tool in tools]
        content = {
            "image": heightmap.source,
            "calibration_id": heightmap.calibration_id,
            "model": heightmap.model,
            "results": [result_as_dict(result) for result in results],
            **faults,
        }
        return content, [*(line for result in results for line in tool_lines(result)), *corrected]
    seed = one_point(options.at, where="--at") if options.at else None
    measurement = judged(measure_heightmap(heightmap, shape=options.shape, seed_mm=seed), heightmap)
    values = measurement.as_json(truth)
    shape = [f"{tr('shape'):<12} {measurement.shape}"] if options.shape == AUTO else []
    return values | faults, [*shape, *measurement_lines(values), *corrected]


def _truths(options: argparse.Namespace) -> dict[str, Truth]:
    """Return the true sizes of each image's object, if a file with them is given."""
    if options.truth is None:
        return {}
    if options.shape is None:
        raise InputError(
            tr("Tools cannot be compared with true sizes"),
            where="--truth",
            advice=Remedy.REMOVE_OPTION,
        )
    rows = {row.file: row.truth for row in read_truth(options.truth).rows}
    for image in options.images:
        if image.name not in rows:
            raise InputError(
                tr("There is no row for {name}").format(name=image.name),
                where=options.truth,
                advice=Remedy.TRUTH_ROW,
            )
    return rows


def tool_lines(result: ToolResult) -> list[str]:
    """Return a tool's result as lines of text, each value with its standard deviation."""
    lines = [f"{result.tool.name}:"]
    for figure in result.figures:
        line = f"  {figure.label:<26} {figure.value:.4f} {figure.unit}"
        lines.append(line + ("" if figure.sd is None else f"  (sd {figure.sd:.4f})"))
    verdict = ": ".join(filter(None, (result.verdict, result.reason)))
    return [*lines, f"  {tr('verdict'):<26} {verdict}"]


def measurement_lines(values: Mapping[str, Any]) -> list[str]:
    """Return a measurement's JSON values as lines of text, each with its standard deviation."""
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
            for part, name in (("noise_sd", tr("noise")), ("calibration_sd", tr("calibration"))):
                if values[part] is not None:
                    line = f"{line[:-1]}, {name} {_numbers(values[part][key])})"
        if key in errors:
            line += tr("  error {e:+.2f} %").format(e=errors[key])
        lines.append(line)
    verdict = ": ".join(filter(None, (values["verdict"], values["reason"])))
    return [*lines, f"{tr('verdict'):<12} {verdict}"]


def _numbers(value: Any) -> str:
    return ", ".join(f"{v:.4f}" for v in (value if isinstance(value, list) else [value]))
