"""``gelpolight profile``: the depth along a line, as a table."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.command_line.common import check_outputs, numbers, one_point
from app.command_line.reconstructing import add_model, load_reconstructor, read_frame
from app.command_line.terminal import say
from gelpolight_core.export.profile_file import write_profiles
from gelpolight_core.measurement.profile import take_profile
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("image", type=Path, metavar="IMAGE")
    for name, key in (("from", "start"), ("to", "end")):
        parser.add_argument(
            f"--{name}",
            dest=key,
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


def run(options: argparse.Namespace) -> int:
    """Reconstruct the image and write its section along the line."""
    check_outputs([options.output], [options.calibration, options.image])
    start = one_point(options.start, where="--from")
    end = one_point(options.end, where="--to")
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    frame = read_frame(options.image, reconstructor)
    heightmap = reconstructor.depth(frame, name=options.image.name, normals=False, uncertainty=True)
    profile = take_profile(heightmap, start, end, width_mm=options.width)
    write_profiles({1: profile}, options.output)
    say(
        tr("{n} points over {length:.3f} mm saved to {path}").format(
            n=profile.along_mm.size, length=profile.along_mm[-1], path=options.output
        )
    )
    return 0
