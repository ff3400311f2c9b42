"""``gelpolight profile``: the depth along a line, as a table."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import (
    add_model,
    load_reconstructor,
    numbers,
    points,
    read_frame,
    refuse_overwriting,
)
from app.command_line.terminal import say
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.export.profile_file import write_profile
from gelpolight_core.measurement.profile import take_profile
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("profile", help=tr("write the depth along a line as CSV"))
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    for name, place in (("from", "start"), ("to", "end")):
        parser.add_argument(
            f"--{name}",
            dest=place,
            type=numbers,
            nargs="+",
            required=True,
            metavar="X Y",
            help=tr("an end of the line, in mm"),
        )
    parser.add_argument(
        "--width", type=float, default=0.0, metavar="MM", help=tr("average over this width")
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.csv")
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct the picture, cut through it and write the section."""
    refuse_overwriting([options.output], [options.calibration, options.image])
    refuse_unwritable(options.output)
    start, end = _place(options.start, "--from"), _place(options.end, "--to")
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    frame = read_frame(options.image, reconstructor)
    heightmap = reconstructor.depth(frame, name=options.image.name, normals=False, uncertainty=True)
    profile = take_profile(heightmap, start, end, width_mm=options.width)
    write_profile(profile, options.output)
    say(
        tr("{n} points over {length:.3f} mm written to {path}").format(
            n=profile.along_mm.size, length=profile.along_mm[-1], path=options.output
        )
    )
    return 0


def _place(given: list[list[float]], where: str) -> tuple[float, float]:
    places = points(given, where=where)
    if len(places) != 1:
        raise InputError(
            tr("{n} places are given").format(n=len(places)),
            where=where,
            advice=tr("Give one: X and Y in mm"),
        )
    return places[0]
