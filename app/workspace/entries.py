"""What the library knows of a calibration file: what it says of itself, and whether to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from app.workspace.validation import Validation, read_validation
from gelpolight_core.calibration.manifest import CalibrationSummary, read_summary
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Entry:
    """One calibration file of the library.

    Attributes
    ----------
    path : Path
        The file.
    summary : CalibrationSummary or None
        What it says of itself; None where it cannot be read.
    broken : str
        Why it cannot be read; empty for a good file.
    validation : Validation or None
        The trial beside it, passed or not.
    validation_note : str
        Why the file beside it does not count: damaged, or of another calibration.
    in_use : bool
        Whether it is the one that the program measures with.
    """

    path: Path
    summary: CalibrationSummary | None
    broken: str = ""
    validation: Validation | None = None
    validation_note: str = ""
    in_use: bool = False

    @property
    def serial(self) -> str:
        """The sensor's serial; of a broken file, the name of its folder."""
        return self.path.parent.name if self.summary is None else self.summary.serial

    @property
    def validated(self) -> bool:
        """Whether this very calibration passed on an object of known size."""
        return (
            self.summary is not None
            and self.validation is not None
            and self.validation.identity == self.summary.identity
            and self.validation.passed
        )

    @property
    def created(self) -> datetime | None:
        """When it was made; None where that is not known."""
        return None if self.summary is None else parse_time(self.summary.created)

    def age_days(self, now: datetime) -> float | None:
        """Return its age; None where it is not known, never negative."""
        made = self.created
        return None if made is None else max(0.0, (now - made).total_seconds() / 86400.0)


def parse_time(text: str) -> datetime | None:
    """Read an ISO 8601 time; one without a zone counts as UTC, one that is none as None."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)


def read_entry(path: Path, *, in_use: bool = False) -> Entry:
    """Return what is known of a calibration file; a broken one is an entry too."""
    try:
        summary = read_summary(path)
    except InputError as error:
        return Entry(path, None, broken=f"{error.found}. {error.advice}.", in_use=in_use)
    try:
        validation = read_validation(path)
    except InputError as error:
        return Entry(path, summary, validation_note=error.found, in_use=in_use)
    note = ""
    if validation is not None and validation.identity != summary.identity:
        note = tr("the validation beside it is of another calibration")
    return Entry(path, summary, "", validation, note, in_use)
