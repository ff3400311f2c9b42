"""``gelpolight refresh``: a closed sensor's calibration after its gel was changed."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

from app.command_line.common import check_outputs, quality_lines
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.calibration.in_place import in_place_towards
from gelpolight_core.calibration.in_place_session import with_background
from gelpolight_core.calibration.project import calibrate
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.user import user_name
from gelpolight_core.reconstruction.in_place.calibration import ClosedSensor
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import average, read_image, require_colour
from gelpolight_core.session.session import read_session
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CALIBRATION")
    given = parser.add_mutually_exclusive_group(required=True)
    given.add_argument(
        "--background",
        type=Path,
        nargs="+",
        metavar="IMAGE",
        help=tr("images of the new gel, untouched; slopes stay as calibrated"),
    )
    given.add_argument(
        "--session",
        type=Path,
        metavar="SESSION",
        help=tr("background and three or more ball presses of the new gel, which correct them"),
    )


def run(options: argparse.Namespace) -> int:
    """Write the refreshed calibration and print its quality."""
    check_outputs([options.output], [options.calibration, *(options.background or [])])
    calibration = read_calibration(options.calibration)
    calibration.data_of(ClosedSensor)
    new = _refreshed(calibration, options)
    write_calibration(new, options.output)
    say("\n".join(quality_lines(new.quality)))
    say(
        tr("Calibration {id} written to {path}: {verdict}").format(
            id=new.identity, path=options.output, verdict=new.verdict.value
        )
    )
    return 0


def _refreshed(calibration: Calibration, options: argparse.Namespace) -> Calibration:
    if options.session is not None:
        session = read_session(options.session)
        recipe = in_place_towards(calibration.data_of(ClosedSensor).in_place.coefficients)
        if not recipe.fits(session):
            raise InputError(
                tr("the session is of an open sensor: session.toml has no table [in_place]"),
                where=options.session,
                advice=Remedy.CHOOSE_SESSION,
            )
        return calibrate(session, recipe).calibration
    images = [read_image(path, response=calibration.response) for path in options.background]
    for path, image in zip(options.background, images, strict=True):
        require_colour(image, where=str(path))
    made = datetime.now(UTC).isoformat(timespec="seconds")
    background = average(images, name=str(options.background[0]))
    return with_background(calibration, background, operator=user_name(), made=made)
