"""``gelpolight report``: a readable report of a calibration, with images."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.command_line.common import stage_progress
from app.command_line.options import Command, option, output, place
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.missing import session_to_calibrate
from gelpolight_core.calibration.project import calibrate
from gelpolight_core.calibration.recipes import recipe_of
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.measurement.evaluation_run import evaluate_presses, press_measurement
from gelpolight_core.measurement.protocol_run import presses_folder
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.build import calibration_report, run_report
from gelpolight_core.report.document import Report as Document
from gelpolight_core.report.document import Validated, refuse_other_endings
from gelpolight_core.report.evaluation import validation_of
from gelpolight_core.report.file import write_report
from gelpolight_core.sensor_calibration import MODELS, Calibration
from gelpolight_core.translation import tr


@dataclass(frozen=True)
class Report(Command):
    """The report of a calibration, or of a session, which is calibrated again."""

    source: Path = place(
        "SESSION_OR_CALIBRATION",
        tr("a calibration file, or a session, which is calibrated again and shown with its images"),
    )
    output: Path = output("FILE.pdf")
    presses: Path | None = option(
        tr("folder of presses with truth.csv or of a protocol run, for validation"),
        metavar="PRESSES",
    )
    model: str | None = option(
        tr("model for the calibration of a session (default: full)"), choices=MODELS
    )

    def run(self) -> None:
        """Write the report and print its path."""
        refuse_other_endings(self.output)
        if self.presses and not self.presses.is_dir():
            raise InputError(
                tr("The path is not a folder with truth.csv"), self.presses, Remedy.CHOOSE_FOLDER
            )
        # Before minutes of work for nothing.
        presses = presses_folder(self.presses) if self.presses else None
        with stage_progress() as progress:
            make = self._of_session if self.source.is_dir() else self._of_calibration
            report = make(presses, progress)
        write_report(report, self.output)
        say(
            tr("Report saved to {path}: {verdict}").format(
                path=self.output, verdict=report.verdict.value
            )
        )

    def _of_calibration(self, presses: Path | None, progress: Any) -> Document:
        if self.model:
            raise InputError(
                tr("A calibration already has its model"), "--model", Remedy.REMOVE_OPTION
            )
        calibration = read_calibration(self.source)
        validation = _validation(calibration, presses, progress)
        return calibration_report(calibration, validation=validation)

    def _of_session(self, presses: Path | None, progress: Any) -> Document:
        session = session_to_calibrate(self.source)
        run = calibrate(session, recipe_of(session, self.model), progress=progress)
        validation = _validation(run.calibration, presses, progress)
        progress(tr("report"), 1.0)
        return run_report(run, validation=validation)


def _validation(calibration: Calibration, presses: Path | None, progress: Any) -> Validated | None:
    if presses is None:
        return None
    measure = press_measurement(Reconstructor(calibration))
    return validation_of(evaluate_presses(presses, measure, progress=progress))
