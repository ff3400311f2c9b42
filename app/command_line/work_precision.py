"""``gelpolight work-precision``: error against run time of every mode."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.command_line.common import stage_progress
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.project import calibrate
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.io.atomic import make_folder, refuse_unwritable
from gelpolight_core.session.session import read_session
from gelpolight_core.studies.work_precision import (
    REPEATS,
    measure_session,
    measure_virtual,
    point_table,
    write_work_precision,
)
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument(
        "session",
        type=Path,
        nargs="?",
        metavar="SESSION",
        help=tr("folder with presses and their true depth (default: the virtual sensor)"),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help=tr("measure with this calibration (default: calibrate first)"),
    )
    parser.add_argument("--repeats", type=int, default=REPEATS, metavar="N")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help=tr("seed of the virtual sensor")
    )


def run(options: argparse.Namespace) -> int:
    """Measure all modes, print the table, and write table and figure."""
    session = None if options.session is None else read_session(options.session)
    calibration = None
    if options.calibration is not None:
        calibration = read_calibration(options.calibration)
    make_folder(options.output)
    refuse_unwritable(options.output / "work-precision.csv")
    repeats = max(options.repeats, 1)
    with stage_progress() as progress:
        if session is None:
            points = measure_virtual(
                SensorDesign(), calibration, repeats=repeats, seed=options.seed, progress=progress
            )
        else:
            if calibration is None:
                calibration = calibrate(session, progress=progress).calibration
            points = measure_session(
                session.folder, calibration, repeats=repeats, progress=progress
            )
    say(point_table(points), end="\n\n")
    written = write_work_precision(points, options.output)
    say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    return 0
