"""Library entry of a calibration file: description and validation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.base.safe_reading import cannot_read, parse_time
from gelpolight_core.calibration.manifest import CalibrationSummary, read_summary
from gelpolight_core.session.validation import WORDS, Validation

ENDING = ".gplcal"
UNLISTED = f"*{ENDING}"
"""Stands for the files of a folder that cannot be listed."""


@dataclass(frozen=True, slots=True)
class CalibrationEntry:
    """One calibration file of the library.

    Attributes
    ----------
    path : Path
        The file.
    summary : CalibrationSummary or None
        Its description. None if it cannot be read.
    broken : str
        Why it cannot be read. Empty for a good file.
    in_use : bool
        Whether it is the calibration in use.
    """

    path: Path
    summary: CalibrationSummary | None
    broken: str = ""
    in_use: bool = False

    @property
    def name(self) -> str:
        """Name of the calibration in the program, from its file."""
        return self.path.stem

    @property
    def serial(self) -> str:
        """The sensor's serial. For a broken file, the name of its folder."""
        return self.path.parent.name if self.summary is None else self.summary.serial

    @property
    def validation(self) -> Validation | None:
        """Validation of the calibration, passed or not."""
        return None if self.summary is None else self.summary.validation

    @property
    def validated(self) -> bool:
        """Whether this calibration passed validation on an object of known size."""
        return self.validation is not None and self.validation.passed

    @property
    def failed(self) -> bool:
        """Whether a quality figure of this calibration failed: it is only a draft."""
        return self.summary is not None and self.summary.verdict is Verdict.FAIL

    @property
    def state(self) -> tuple[str, str]:
        """Reliability of the calibration as a word or two, with a colour role."""
        if self.broken or self.failed:
            return ("broken" if self.broken else "failed"), "fail"
        trial = self.validation
        word = "not validated" if trial is None else WORDS[trial.verdict].lower()
        return word, "pass" if self.validated else "warn"

    @property
    def created(self) -> datetime | None:
        """Time of the calibration. None if unknown."""
        return None if self.summary is None else parse_time(self.summary.created)

    def age_days(self, now: datetime) -> float | None:
        """Return its age. None if unknown, never negative."""
        created = self.created
        return None if created is None else max(0.0, (now - created) / timedelta(days=1))


def calibrations_in(parent: Path) -> list[Path]:
    """Return the calibration files in the folders of a folder.

    A folder that cannot be listed has one path, :data:`UNLISTED`, whose entry says why.

    Raises
    ------
    OSError
        If the folder itself cannot be listed.
    """
    paths: list[Path] = []
    try:
        folders = [parent / name for name in os.listdir(parent)]
    except FileNotFoundError:
        return paths
    for folder in folders:
        try:
            names = os.listdir(folder)
        except NotADirectoryError:
            continue
        except OSError:
            names = [UNLISTED]
        paths += [folder / name for name in names if name.endswith(ENDING) and name[0] != "."]
    return sorted(paths)


def read_entry(path: Path, *, in_use: bool = False) -> CalibrationEntry:
    """Return the library entry of a calibration file, including broken ones."""
    try:
        refuse_unlisted(path)
        return CalibrationEntry(path, read_summary(path), in_use=in_use)
    except InputError as error:
        return CalibrationEntry(path, None, broken=f"{error.found}. {error.advice}.", in_use=in_use)


def refuse_unlisted(path: Path) -> None:
    """Refuse a path that stands for the files of a folder.

    Raises
    ------
    InputError
        If the folder cannot be listed.
    """
    try:
        if path.name == UNLISTED:
            os.listdir(path.parent)
    except OSError as error:
        raise cannot_read(error, path.parent) from error
