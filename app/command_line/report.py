"""``gelpolight report``: a readable report of a calibration, with images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from app.command_line.common import stage_progress, tolerance, tolerances
from app.command_line.options import Command, option, output, place
from app.command_line.terminal import say
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.project import calibrate
from gelpolight_core.calibration.recipes import recipe_of, session_to_calibrate
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.measurement.evaluation_run import evaluate_presses, press_measurement
from gelpolight_core.measurement.presses import presses_folder
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.report.build import calibration_report
from gelpolight_core.report.document import Report as Document
from gelpolight_core.report.document import Validated, refuse_other_endings
from gelpolight_core.report.evaluation import validation_of
from gelpolight_core.report.file import write_report
from gelpolight_core.sensor_calibration import MODELS, Calibration

Validation = Callable[[Calibration], Validated | None]


@dataclass(frozen=True)
class Report(Command):
    """The report of a calibration, or of a session, which is calibrated again."""

    source: Path = place(
        "SESSION_OR_CALIBRATION",
        "a calibration file, or a session, which is calibrated again and shown with its images",
    )
    output: Path = output("FILE.pdf")
    presses: Path | None = option(
        "folder of presses with truth.csv, or of their session, for validation",
        metavar="PRESSES",
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
            validated = partial(_validation, presses, limits_percent, progress)
            make = self._of_session if self.source.is_dir() else self._of_calibration
            report = make(validated, progress)
        write_report(report, self.output)
        say(f"Report saved to {self.output}: {report.verdict.value}")

    def _of_calibration(self, validated: Validation, _progress: Any) -> Document:
        if self.model:
            raise InputError("A calibration already has its model", "--model", Remedy.REMOVE_OPTION)
        calibration = read_calibration(self.source)
        return calibration_report(calibration, validation=validated(calibration))

    def _of_session(self, validated: Validation, progress: Any) -> Document:
        session = session_to_calibrate(self.source)
        run = calibrate(session, recipe_of(session, self.model), progress=progress)
        validation = validated(run.calibration)
        progress("report", 1.0)
        return calibration_report(run.calibration, run, validation=validation)


def _validation(
    presses: Path | None,
    limits_percent: tuple[float, float],
    progress: Any,
    calibration: Calibration,
) -> Validated | None:
    if presses is None:
        return None
    measure = press_measurement(Reconstructor(calibration))
    evaluation = evaluate_presses(presses, measure, progress=progress)
    return validation_of(replace(evaluation, limits_percent=limits_percent))
