"""``gelpolight evaluate``: the paper's evaluation on a folder of presses with true values."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from app.command_line.common import stage_progress
from app.command_line.reconstructing import add_model, load_reconstructor
from app.command_line.terminal import say
from gelpolight_core.batch.workers import processes
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.measurement.evaluation_run import (
    evaluate_presses,
    measure_with,
    press_measurement,
)
from gelpolight_core.measurement.protocol_run import presses_folder
from gelpolight_core.report.evaluation import evaluation_table, write_evaluation_files
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument(
        "presses",
        type=Path,
        metavar="PRESSES",
        help=tr("folder of images with truth.csv, or folder of a protocol run"),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    add_model(parser)
    parser.add_argument(
        "--workers",
        type=int,
        choices=range(1, 65),
        default=1,
        metavar="N",
        help=tr("number of images processed at the same time, one process each"),
    )


def run(options: argparse.Namespace) -> int:
    """Measure every press, write the report's files and print the table."""
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    presses = presses_folder(options.presses)  # before a folder is created for nothing
    make_folder(options.output)
    with stage_progress() as progress:
        if options.workers > 1:
            remote = partial(measure_with, options.calibration, options.model)
            with processes(options.workers) as pool:
                evaluation = evaluate_presses(
                    presses, remote, progress=progress, submit=pool.submit
                )
        else:
            measure = press_measurement(reconstructor)
            evaluation = evaluate_presses(presses, measure, progress=progress)
    written = write_evaluation_files(
        evaluation, options.output, calibration=reconstructor.calibration
    )
    say(evaluation_table(evaluation))
    say(tr("Saved: {files}").format(files=", ".join(str(path) for path in written)))
    if len(evaluation.failed) == len(evaluation.results):
        raise InputError(
            tr("None of the {n} presses could be measured ({reason})").format(
                n=len(evaluation.results), reason=str(evaluation.failed[0].outcome).rstrip(".")
            ),
            where=presses,
            advice=Remedy.SAME_SENSOR,
        )
    return 0
