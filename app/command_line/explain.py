"""``gelpolight explain``: where the errors of presses with a true depth come from."""

from __future__ import annotations

import argparse
from pathlib import Path

from app.command_line.common import StageProgress
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_open_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.explain import explain
from gelpolight_core.experiments.explain_report import explanation_text, write_explanation
from gelpolight_core.io.atomic import make_folder, refuse_unwritable
from gelpolight_core.session.session import read_session
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument(
        "session",
        type=Path,
        metavar="SESSION",
        help=tr("session folder with presses and their true depth"),
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT", help=tr("folder for height.csv and light.csv")
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print where the errors come from, and write the tables if asked."""
    calibration = read_open_calibration(options.calibration)
    if calibration.full is None:
        raise InputError(
            tr("The calibration has no full model"),
            where=str(options.calibration),
            advice=tr("Calibrate the session again with --model full"),
        )
    session = read_session(options.session)
    if options.output is not None:  # before the long work
        make_folder(options.output)
        refuse_unwritable(options.output / "height.csv")
    with StageProgress() as progress:
        explanation = explain(calibration, session, progress=progress)
    say(explanation_text(explanation))
    if options.output is not None:
        written = write_explanation(explanation, options.output)
        say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    return 0
