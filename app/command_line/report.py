"""``gelpolight report``: a calibration as a document for people, with pictures."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.command_line.common import StageProgress, refuse_overwriting, session_files
from app.command_line.terminal import say
from gelpolight_core.calibration.calibration import MODELS, Calibration
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.pipeline import calibrate_session
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import refuse_unwritable
from gelpolight_core.measurement.evaluation import evaluate_presses
from gelpolight_core.measurement.presses import picture_reconstruction
from gelpolight_core.measurement.protocol_run import crossing_of, presses_folder
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.build import calibration_report, run_report, validation_of
from gelpolight_core.report.document import Report, Validation
from gelpolight_core.report.file import refuse_other_endings, write_report
from gelpolight_core.session.session import Session, read_session
from gelpolight_core.translation import tr


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser("report", help=tr("write a calibration's report, HTML or PDF"))
    parser.add_argument(
        "source",
        type=Path,
        metavar="SESSION_OR_CALIBRATION",
        help=tr("a session is calibrated anew and shown with its pictures"),
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.html|FILE.pdf")
    parser.add_argument(
        "--presses",
        type=Path,
        metavar="PRESSES",
        help=tr("folder of presses with truth.csv, or of a run of the protocol, to validate with"),
    )
    parser.add_argument(
        "--model", choices=MODELS, help=tr("to calibrate a session for (full unless stated)")
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Write the report and say where it is."""
    refuse_other_endings(options.output)
    presses = _presses(options.presses)  # before minutes of work for nothing
    make = _of_session if options.source.is_dir() else _of_calibration
    report = make(options, presses)
    write_report(report, options.output)
    say(
        tr("Report written to {path}: {verdict}").format(
            path=options.output, verdict=report.verdict.value
        )
    )
    return 0


def _presses(given: Path | None) -> Path | None:
    """Return the folder of the presses to validate with; refuse what cannot be used."""
    if given is None:
        return None
    if not given.is_dir():
        raise InputError(
            tr("it is not a folder"),
            where=str(given),
            advice=tr("Name the folder that holds truth.csv and its pictures"),
        )
    presses = presses_folder(given)
    read_truth(presses)
    crossing_of(presses)
    return presses


def _of_calibration(options: argparse.Namespace, presses: Path | None) -> Report:
    if options.model:
        raise InputError(
            tr("a calibration has its model already"),
            where="--model",
            advice=tr("Leave it out, or name a session folder"),
        )
    refuse_overwriting([options.output], [options.source])
    refuse_unwritable(options.output)
    calibration = read_calibration(options.source)
    with StageProgress() as tell:
        validation = _validate(calibration, presses, tell)
    return calibration_report(calibration, validation=validation)


def _of_session(options: argparse.Namespace, presses: Path | None) -> Report:
    session: Session = read_session(options.source)
    refuse_overwriting([options.output], session_files(session))
    refuse_unwritable(options.output)
    with StageProgress() as tell:
        result = calibrate_session(session, model=options.model or MODELS[-1], progress=tell)
        validation = _validate(result.calibration, presses, tell)
        tell(tr("report"), 1.0)
        return run_report(result, session, validation=validation)


def _validate(calibration: Calibration, presses: Path | None, tell: Any) -> Validation | None:
    if presses is None:
        return None
    reconstruct = picture_reconstruction(Reconstructor(calibration))
    crossing = crossing_of(presses)
    return validation_of(evaluate_presses(presses, reconstruct, progress=tell, crossing=crossing))
