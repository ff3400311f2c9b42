"""``gelpolight reconstruct``: pictures and recordings become height maps."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from tqdm import tqdm

from app.command_line.common import (
    add_effort,
    add_model,
    load_reconstructor,
    plan_lines,
    refuse_overwriting,
)
from app.command_line.inputs import Inputs
from app.command_line.terminal import say
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder
from gelpolight_core.export.heightmap_files import FORMATS, ending, write_heightmap
from gelpolight_core.export.preview import write_preview
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "reconstruct", help=tr("turn pictures and recordings into depth maps in mm")
    )
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument(
        "images", type=Path, nargs="+", metavar="IMAGE", help=tr("pictures and recordings")
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--format",
        default="npz",
        metavar="LIST",
        help=tr("comma-separated list of {formats}").format(formats=", ".join(FORMATS)),
    )
    parser.add_argument(
        "--pictures", action="store_true", help=tr("also a picture of each depth map (PNG)")
    )
    parser.add_argument(
        "--uncertainty",
        action="store_true",
        help=tr("also standard deviations, in npz; takes several times as long"),
    )
    parser.add_argument(
        "--frames",
        default="",
        metavar="A:B",
        help=tr("of a recording, the frames from A, counted from 0, up to but not with B"),
    )
    parser.add_argument(
        "--explain",
        action="store_true",
        help=tr("say which steps each picture needed, and why the others were left out"),
    )
    add_effort(parser)
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct every picture and write its files."""
    formats = [name.strip() for name in options.format.split(",") if name.strip()]
    unknown = sorted(set(formats) - set(FORMATS))
    if unknown or not formats:
        raise InputError(
            tr("unknown format {name}").format(name=", ".join(unknown) or '""'),
            where="--format",
            advice=tr("Use one or more of {formats}").format(formats=", ".join(FORMATS)),
        )
    if options.uncertainty and "npz" not in formats:
        raise InputError(
            tr("only npz has room for standard deviations"),
            where="--uncertainty",
            advice=tr("Add npz to --format, or leave it out"),
        )
    endings = dict.fromkeys([*map(ending, formats), *(["png"] if options.pictures else [])])
    with Inputs(options.images, options.frames) as inputs:
        outputs = [options.output / f"{item.stem}.{e}" for item in inputs.items for e in endings]
        refuse_overwriting(outputs, [options.calibration, *options.images])
        reconstructor = load_reconstructor(
            options.calibration, model=options.model, effort=options.effort
        )
        inputs.require_match(reconstructor.calibration)
        make_folder(options.output)
        for item in inputs:
            picture = item.read(reconstructor.calibration.response)
            heightmap = reconstructor.depth(
                picture.rgb, name=item.name, uncertainty=options.uncertainty
            )
            write_heightmap(heightmap, options.output, formats=formats)
            if options.explain and heightmap.plan is not None:
                tqdm.write("\n".join([f"{item.where}:", *plan_lines(heightmap.plan)]))
            for note in heightmap.notes:
                tqdm.write(f"{item.where}: {note}", file=sys.stderr)
            if options.pictures:
                write_preview(heightmap, picture.rgb, options.output / f"{item.stem}.png")
    say(tr("{n} depth maps written to {folder}").format(n=len(inputs.items), folder=options.output))
    return 0
