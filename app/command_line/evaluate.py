"""``gelpolight evaluate``: the paper's evaluation on a folder of presses with their truth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import StageProgress, add_model, add_workers, load_reconstructor
from app.command_line.terminal import say
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.press_workers import Equipment
from gelpolight_core.experiments.virtual_protocol import measure_folder
from gelpolight_core.export.atomic import make_folder
from gelpolight_core.measurement.evaluation import Evaluation, evaluate_presses
from gelpolight_core.measurement.evaluation_report import evaluation_table
from gelpolight_core.measurement.presses import open_ledger, picture_reconstruction
from gelpolight_core.measurement.protocol_run import crossing_of, presses_folder
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.report.evaluation_files import write_evaluation_files
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("evaluate", help=tr("compare measured presses with their truth"))
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument(
        "presses",
        type=Path,
        metavar="PRESSES",
        help=tr("folder of pictures with truth.csv, or of a run of the protocol"),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    add_model(parser)
    add_workers(parser, default=1)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure every press, write the report's files and print the table."""
    reconstructor = load_reconstructor(options.calibration, model=options.model)
    presses = presses_folder(options.presses)
    read_truth(presses)  # before a folder is made for nothing
    crossing = crossing_of(presses)
    make_folder(options.output)
    ledger = open_ledger(None, reconstructor)
    with StageProgress() as tell:
        if options.workers > 1:
            equipment = Equipment(options.calibration, options.model)
            measure_folder(presses, equipment, ledger, workers=options.workers, progress=tell)
        evaluation = evaluate_presses(
            presses,
            picture_reconstruction(reconstructor),
            progress=tell,
            crossing=crossing,
            ledger=ledger,
        )
    report(evaluation, reconstructor.calibration, options.output, presses)
    return 0


def report(evaluation: Evaluation, calibration: Calibration, output: Path, presses: Path) -> None:
    """Write the report's files and print the table; refuse where nothing could be measured."""
    written = write_evaluation_files(evaluation, output, calibration=calibration)
    say(evaluation_table(evaluation))
    say(tr("Written: {files}").format(files=", ".join(str(path) for path in written)))
    if len(evaluation.failed) == len(evaluation.results):
        raise InputError(
            tr("none of the {n} presses could be measured ({reason})").format(
                n=len(evaluation.results), reason=evaluation.failed[0].failure.rstrip(".")
            ),
            where=str(presses),
            advice=tr("Check that the calibration is this sensor's"),
        )
