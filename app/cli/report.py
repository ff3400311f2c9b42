"""``gelpolight report``: a readable report of a calibration, with images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.calibration.recipes import recipe_of, session_to_calibrate
from gelpolight_core.lab.evaluation_report import validation_of
from gelpolight_core.lab.evaluation_run import evaluate_presses, press_measurement
from gelpolight_core.lab.press_folder import presses_folder
from gelpolight_core.output.report.calibration_report import calibration_report
from gelpolight_core.output.report.document import refuse_other_endings
from gelpolight_core.output.report.report_pdf_file import write_report
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import MODELS

from .common import stage_progress, tolerance, tolerances
from .options import Command, option, output, positional
from .terminal import print_safe


@dataclass(frozen=True)
class ReportCommand(Command):
    """The report of a calibration, or of a session, which is calibrated again."""

    source: Path = positional(
        "SESSION_OR_CALIBRATION",
        "a calibration file, or a session, which is calibrated again and shown with its images",
    )
    output: Path = output("FILE.pdf")
    presses: Path | None = option(
        "folder of presses with truth.csv, or of their session, for validation", metavar="PRESSES"
    )
    tolerance: tuple[float, float] | None = tolerance()
    model: str | None = option(
        "model for the calibration of a session (default: full)", choices=MODELS
    )

    def run(self) -> None:
        """Write the report and print its path."""
        refuse_other_endings(self.output)
        if self.presses and not self.presses.is_dir():
            raise InputError(
                "The path is not a folder with truth.csv", self.presses, Remedy.CHOOSE_FOLDER
            )
        # Before minutes of work for nothing.
        presses = presses_folder(self.presses) if self.presses else None
        limits_percent = tolerances(self.tolerance)
        with stage_progress() as progress:
            if self.source.is_dir():
                session = session_to_calibrate(self.source)
                recipe = recipe_of(session, self.model)
                run = run_calibration(
                    session, recipe, progress=progress, tolerance_percent=limits_percent[1]
                )
                calibration = run.calibration
            elif self.model:
                message = "A calibration already has its model"
                raise InputError(message, "--model", Remedy.REMOVE_OPTION)
            else:
                run, calibration = None, read_calibration(self.source)
            validation = None
            if presses is not None:
                measure = press_measurement(Reconstructor(calibration))
                evaluation = evaluate_presses(presses, measure, progress=progress)
                validation = validation_of(replace(evaluation, limits_percent=limits_percent))
            progress("report", 1.0)
            report = calibration_report(calibration, run, validation=validation)
        write_report(report, self.output)
        print_safe(f"Report saved to {self.output}: {report.verdict}")
