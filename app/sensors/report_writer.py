"""Writes the report of a calibration of the library."""

from __future__ import annotations

from pathlib import Path

from app.sensors.details import trial_lines
from app.workspace.entries import Entry


def write_entry_report(entry: Entry, path: Path) -> None:
    """Write the report of a calibration of the library, with its validation.

    Raises
    ------
    InputError
        If the calibration cannot be read or the file cannot be written.
    """
    from gelpolight_core.calibration.file import read_calibration  # slow imports
    from gelpolight_core.report.build import calibration_report
    from gelpolight_core.report.document import Validation
    from gelpolight_core.report.file import refuse_other_endings, write_report

    refuse_other_endings(path)
    lines = trial_lines(entry)
    validation = Validation("; ".join(lines)) if entry.validation is not None else None
    write_report(calibration_report(read_calibration(entry.path), validation=validation), path)
