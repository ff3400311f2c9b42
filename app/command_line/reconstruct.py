"""``gelpolight reconstruct``: turns images and recordings into height maps."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from app.command_line.common import refuse_overwriting
from app.command_line.inputs import Inputs
from app.command_line.parser import MENDABLE
from app.command_line.reconstructing import (
    PREVIEW,
    add_despite_faults,
    add_effort,
    add_format,
    add_model,
    load_reconstructor,
    trace_lines,
)
from app.command_line.terminal import say
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.export.heightmap_files import ending, write_heightmap
from gelpolight_core.export.preview import write_preview
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument(
        "images", type=Path, nargs="+", metavar="IMAGE", help=tr("images and recordings")
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    add_format(parser, preview=True)
    parser.add_argument(
        "--uncertainty",
        action="store_true",
        help=tr("also compute standard deviations, in npz; takes several times as long"),
    )
    parser.add_argument(
        "--frames",
        default="",
        metavar="A:B:N",
        help=tr(
            "every N-th frame of a recording from A, counted from 0, up to but not including B"
        ),
    )
    parser.add_argument(
        "--explain",
        action="store_true",
        help=tr("show the steps of each image, and why steps were skipped"),
    )
    add_despite_faults(parser)
    add_effort(parser)
    add_model(parser)


def run(options: argparse.Namespace) -> int:
    """Reconstruct every image and write its files."""
    formats = [name for name in options.format if name != PREVIEW]
    if options.uncertainty and "npz" not in formats:
        raise InputError(
            tr("Only npz can contain standard deviations"),
            where="--uncertainty",
            advice=Remedy.REMOVE_OPTION,
        )
    endings = ["png" if name == PREVIEW else ending(name) for name in options.format]
    with Inputs(options.images, options.frames) as inputs:
        outputs = [options.output / f"{item.stem}.{e}" for item in inputs.items for e in endings]
        refuse_overwriting(outputs, [options.calibration, *options.images])
        reconstructor = load_reconstructor(
            options.calibration, model=options.model, effort=options.effort
        )
        inputs.require_match(reconstructor.calibration)
        make_folder(options.output)
        refused = 0
        for item in inputs:
            image = item.read(reconstructor.calibration.response)
            health = reconstructor.health(image.rgb, name=item.name)
            fault = health.meaningless
            if fault is not None and not options.despite_faults:
                refused += 1
                say(f"gelpolight: {item.where}: {fault.line}", file=sys.stderr)
                continue
            heightmap = reconstructor.depth(
                image.rgb, name=item.name, uncertainty=options.uncertainty, health=health
            )
            write_heightmap(heightmap, options.output, formats=formats)
            if options.explain and heightmap.trace is not None:
                tqdm.write("\n".join([f"{item.where}:", *trace_lines(heightmap.trace)]))
            for finding in heightmap.findings:
                tqdm.write(f"{item.where}: {finding.line}", file=sys.stderr)
            if PREVIEW in options.format:
                write_preview(heightmap, image.rgb, options.output / f"{item.stem}.png")
    saved = len(inputs.items) - refused
    say(tr("{n} depth maps saved to {folder}").format(n=saved, folder=options.output))
    if refused:
        text = tr("{n} images were refused. Add --despite-faults to use them anyway.")
        say(f"gelpolight: {text.format(n=refused)}", file=sys.stderr)
    return MENDABLE if refused else 0
