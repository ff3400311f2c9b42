"""``gelpolight report``: a readable report of a calibration, with images."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import refuse_overwriting, stage_progress
from app.command_line.sessions import session_files
from app.command_line.terminal import say
from app.workspace.entries import read_entry
from app.workspace.report import stated_validation
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.missing import session_to_calibrate
from gelpolight_core.calibration.project import calibrate
from gelpolight_core.calibration.recipes import recipe_of
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import refuse_unwritable
from gelpolight_core.measurement.evaluation_run import evaluate_presses, press_measurement
from gelpolight_core.measurement.protocol_run import presses_folder
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.build import calibration_report, run_report
from gelpolight_core.report.document import Report, Validation
from gelpolight_core.report.evaluation import validation_of
from gelpolight_core.report.file import refuse_other_endings, write_report
from gelpolight_core.sensor_calibration import MODELS, Calibration
from gelpolight_core.translation import tr


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument(
        "source",
        type=Path,
        metavar="SESSION_OR_CALIBRATION",
        help=tr(
            "a calibration file, or a session, which is calibrated again and shown with its images"
        ),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.pdf")
    parser.add_argument(
        "--presses",
        type=Path,
        metavar="PRESSES",
        help=tr("folder of presses with truth.csv or of a protocol run, for validation"),
    )
    parser.add_argument(
        "--model", choices=MODELS, help=tr("model for the calibration of a session (default: full)")
    )


def run(options: argparse.Namespace) -> int:
    """Write the report and print its path."""
    refuse_other_endings(options.output)
    presses = _presses(options.presses)  # before minutes of work for nothing
    make = _of_session if options.source.is_dir() else _of_calibration
    report = make(options, presses)
    write_report(report, options.output)
    say(
        tr("Report saved to {path}: {verdict}").format(
            path=options.output, verdict=report.verdict.value
        )
    )
    return 0


def _presses(given: Path | None) -> Path | None:
    """Return the folder of the validation presses. Raise an error if it cannot be used."""
    if given is None:
        return None
    if not given.is_dir():
        raise InputError(
            tr("The path is not a folder with truth.csv"), where=given, advice=Remedy.CHOOSE_FOLDER
        )
    return presses_folder(given)


def _of_calibration(options: argparse.Namespace, presses: Path | None) -> Report:
    if options.model:
        raise InputError(
            tr("A calibration already has its model"), where="--model", advice=Remedy.REMOVE_OPTION
        )
    refuse_overwriting([options.output], [options.source])
    refuse_unwritable(options.output)
    calibration = read_calibration(options.source)
    with stage_progress() as progress:
        validation = _validate(calibration, presses, progress)
    if validation is None:
        validation = stated_validation(read_entry(options.source))
    return calibration_report(calibration, validation=validation)


def _of_session(options: argparse.Namespace, presses: Path | None) -> Report:
    session = session_to_calibrate(options.source)
    recipe = recipe_of(session, options.model)
    refuse_overwriting([options.output], session_files(session))
    refuse_unwritable(options.output)
    with stage_progress() as progress:
        result = calibrate(session, recipe, progress=progress)
        validation = _validate(result.calibration, presses, progress)
        progress(tr("report"), 1.0)
        return run_report(result, validation=validation)


def _validate(calibration: Calibration, presses: Path | None, progress: Any) -> Validation | None:
    if presses is None:
        return None
    measure = press_measurement(Reconstructor(calibration))
    return validation_of(evaluate_presses(presses, measure, progress=progress))
