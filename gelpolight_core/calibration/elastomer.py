"""Name the elastomer of a calibration that was made before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import plain_text
from gelpolight_core.translation import tr

ELASTOMER_LENGTH = 80


def name_elastomer(path: Path, elastomer: str) -> None:
    """State the name or serial number of the elastomer in a calibration file. Empty: none.

    The calibration keeps its identity: its validation and its measurements stay valid.

    Raises
    ------
    InputError
        If the text cannot be used, or the file cannot be read or written.
    """
    try:
        plain_text(elastomer, ELASTOMER_LENGTH)
    except ValueError as error:
        raise InputError(
            tr("The name of the elastomer is not plain text of at most {n} characters").format(
                n=ELASTOMER_LENGTH
            ),
            where=str(path),
            advice=tr("Enter a shorter name without special characters"),
        ) from error
    calibration = read_calibration(path)
    stated = replace(calibration.provenance, elastomer=elastomer.strip())
    named = replace(calibration, provenance=stated)
    vars(named)["identity"] = calibration.identity
    write_calibration(named, path)
