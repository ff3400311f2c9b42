"""``gelpolight import``: a calibration folder of another library as a closed sensor's session."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.command_line.terminal import say
from gelpolight_core.in_place.foreign import FORMS, read_foreign
from gelpolight_core.in_place.import_session import Stated, import_session
from gelpolight_core.in_place.preset import preset_named, presets
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    names = ", ".join(sorted(preset.key for preset in presets()))
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help=tr("with one of: {forms}").format(forms=FORMS)
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="SESSION")
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help=tr("kind of sensor, for its scale: {names}, or a TOML file").format(names=names),
    )
    parser.add_argument("--mm-per-px", type=_length, metavar="MM", help=tr("size of a pixel"))
    parser.add_argument(
        "--ball-diameter", type=_length, metavar="MM", help=tr("where the folder does not state it")
    )
    parser.add_argument(
        "--background", type=Path, metavar="IMAGE", help=tr("the untouched membrane")
    )
    parser.add_argument("--serial", default="", metavar="NAME", help=tr("name of the sensor"))


def run(options: argparse.Namespace) -> int:
    """Write the session."""
    found = read_foreign(options.folder)
    diameter = options.ball_diameter
    stated = Stated(
        options.serial or options.folder.resolve().name,
        options.mm_per_px,
        None if diameter is None else 0.5 * diameter,
        options.background,
        preset_named(options.preset) if options.preset else None,
    )
    session = import_session(found, stated, options.output)
    say(
        tr("{n} presses from {form} saved to {folder}; {k} with a labelled circle").format(
            n=len(found.presses),
            form=found.form,
            folder=options.output,
            k=len(session.decisions.balls),
        )
    )
    if stated.preset is not None and stated.preset.limits:
        say(stated.preset.limits)
    return 0


def _length(text: str) -> float:
    """Return a length in mm."""
    value = float(text)
    if not 1e-4 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(tr("{text} is not a possible length").format(text=text))
    return value
