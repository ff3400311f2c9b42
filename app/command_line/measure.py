"""``gelpolight measure``: how large the pressed object is."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import add_model, load_reconstructor, refuse_overwriting, write_json
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.measurement.measure import SHAPES, measure_object
from gelpolight_core.measurement.result import Comparison, Measurement, compare
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.session.session import read_picture, require_colour
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("measure", help=tr("say how large the pressed object is"))
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    parser.add_argument("--shape", required=True, choices=SHAPES)
    parser.add_argument(
        "--truth", type=Path, metavar="FILE", help=tr("truth.csv with this picture")
    )
    parser.add_argument(
        "--seed",
        type=float,
        nargs=2,
        metavar=("X", "Y"),
        help=tr("a point (mm) on the object to measure, where several are pressed"),
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct the picture, fit the object and print its size."""
    if options.json:
        used = [options.calibration, options.image, options.truth]
        refuse_overwriting([options.json], filter(None, used))
        refuse_unwritable(options.json)
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    truth = None
    if options.truth is not None:
        rows = {row.file: row.truth for row in read_truth(options.truth).rows}
        truth = rows.get(options.image.name)
        if truth is None:
            raise InputError(
                tr("there is no row for {name}").format(name=options.image.name),
                where=str(options.truth),
                advice=tr("Add the picture with its shape and true sizes"),
            )
    picture = read_picture(options.image, response=reconstructor.calibration.response)
    require_colour(picture, where=str(options.image))
    heightmap = reconstructor.depth(
        picture.rgb, name=options.image.name, normals=False, uncertainty=True
    )
    measurement = measure_object(
        heightmap.depth_mm,
        heightmap.x_mm,
        heightmap.y_mm,
        shape=options.shape,
        seed_mm=tuple(options.seed) if options.seed else None,
        flags=heightmap.flags,
        noise_mm=heightmap.noise_mm,
        depth_scale_sd=heightmap.depth_scale_sd,
        lateral_scale_sd=heightmap.lateral_scale_sd,
    )
    comparison = None if truth is None else compare(measurement, truth)
    if options.json:
        write_json(measurement.as_json(comparison), options.json)
    print("\n".join(measurement_lines(measurement, comparison)))
    return 0


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
