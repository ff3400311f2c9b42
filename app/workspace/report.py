"""The report of a calibration of the library, with its validation."""

from __future__ import annotations

from pathlib import Path

from app.workspace.entries import Entry, validation_lines
from gelpolight_core.finding import Verdict
from gelpolight_core.report.document import Validation


def stated_validation(entry: Entry) -> Validation | None:
    """Return the validation next to a calibration file for its report; None if there is none."""
    trial, sentence = entry.validation, "; ".join(validation_lines(entry))
    if entry.validation_note:
        return Validation(sentence, Verdict.WARN)
    if trial is None:
        return None
    return Validation(
        sentence, Verdict.PASS if trial.passed else Verdict.FAIL, data=trial.as_json()
    )


def write_entry_report(entry: Entry, path: Path) -> None:
    """Write the report of a calibration of the library, with its validation.

    Raises
    ------
    InputError
        If the calibration cannot be read or the file cannot be written.
    """
    from gelpolight_core.calibration.file import read_calibration  # slow imports
    from gelpolight_core.report.build import calibration_report
    from gelpolight_core.report.file import refuse_other_endings, write_report

    refuse_other_endings(path)
    validation = stated_validation(entry)
    write_report(calibration_report(read_calibration(entry.path), validation=validation), path)
