"""Remarks that a calibration file gets after it was made. Its identity does not change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import plain_text
from gelpolight_core.session.validation import Validation

from .calibration_file import read_calibration, write_calibration
from .manifest import REMARK_LENGTH


def write_reason(text: str, path: Path) -> None:
    """Write into a calibration file why it is used although it failed. Empty: it is not.

    The calibration keeps its identity: its validation and its measurements stay valid.

    Parameters
    ----------
    text : str
        At most `REMARK_LENGTH` characters.
    path : Path
        The calibration file.

    Raises
    ------
    InputError
        If the text cannot be used, or the file cannot be read or written.
    """
    try:
        plain_text(text, REMARK_LENGTH)
    except ValueError as error:
        raise InputError(
            f"The text is not plain text of at most {REMARK_LENGTH} characters",
            path,
            Remedy.CORRECT_VALUE,
        ) from error
    calibration = read_calibration(path)
    provenance = replace(calibration.provenance, accepted=text.strip())
    write_calibration(replace(calibration, provenance=provenance), path)


def write_validation(validation: Validation, path: Path) -> None:
    """Write a validation into the file of its calibration, in place of an earlier one.

    Raises
    ------
    InputError
        If the file cannot be read or written.
    """
    write_calibration(replace(read_calibration(path), validation=validation), path)
