"""Library entry of a calibration file: its own description and its validation."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from app.workspace.validation import Validation, read_validation
from gelpolight_core.calibration.manifest import CalibrationSummary, read_summary
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Verdict
from gelpolight_core.translation import tr


@dataclass(frozen=True, slots=True)
class Entry:
    """One calibration file of the library.

    Attributes
    ----------
    path : Path
        The file.
    summary : CalibrationSummary or None
        Its description. None if it cannot be read.
    broken : str
        Why it cannot be read. Empty for a good file.
    validation : Validation or None
        Its validation, passed or not.
    validation_note : str
        Why the validation file is ignored: damaged, or of another calibration.
    in_use : bool
        Whether it is the calibration in use.
    """

    path: Path
    summary: CalibrationSummary | None
    broken: str = ""
    validation: Validation | None = None
    validation_note: str = ""
    in_use: bool = False

    @property
    def name(self) -> str:
        """Name of the calibration in the program: that of its file."""
        return self.path.stem

    @property
    def serial(self) -> str:
        """The sensor's serial. For a broken file, the name of its folder."""
        return self.path.parent.name if self.summary is None else self.summary.serial

    @property
    def validated(self) -> bool:
        """Whether this calibration passed validation on an object of known size."""
        return (
            self.summary is not None
            and self.validation is not None
            and self.validation.identity == self.summary.identity
            and self.validation.passed
        )

    @property
    def failed(self) -> bool:
        """Whether a quality figure of this calibration failed: it is only a draft."""
        return self.summary is not None and self.summary.verdict is Verdict.FAIL

    @property
    def state(self) -> tuple[str, str]:
        """How far it can be trusted: in a word or two, and as a colour role."""
        if self.broken or self.failed:
            return (tr("broken") if self.broken else tr("failed")), "fail"
        return (tr("validated"), "pass") if self.validated else (tr("not validated"), "warn")

    @property
    def created(self) -> datetime | None:
        """Time of the calibration. None if unknown."""
        return None if self.summary is None else parse_time(self.summary.created)

    def age_days(self, now: datetime) -> float | None:
        """Return its age. None if unknown, never negative."""
        made = self.created
        return None if made is None else max(0.0, (now - made).total_seconds() / 86400.0)


def parse_time(text: str) -> datetime | None:
    """Read an ISO 8601 time. Without a time zone it counts as UTC. Invalid text gives None."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)


def read_entry(path: Path, *, in_use: bool = False) -> Entry:
    """Return the library entry of a calibration file, including broken ones."""
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
        note = tr("the validation next to it belongs to another calibration")
    return Entry(path, summary, "", validation, note, in_use)


def validation_lines(entry: Entry) -> list[str]:
    """Return the validation of a calibration on an object of known size, with its results."""
    trial = entry.validation
    if trial is None or entry.validation_note:
        note = entry.validation_note or tr("press an object of known size to validate it")
        return [tr("Not validated: {note}").format(note=note)]
    word = tr("Validated") if trial.passed else tr("Validation failed")
    when = parse_time(trial.when)
    day = trial.when if when is None else f"{when.astimezone():%Y-%m-%d %H:%M}"
    by = tr("by {name}").format(name=trial.who) if trial.who else ""
    line = tr("{what}: {a:.3f} mm measured, {b:.3f} mm true, {e:+.1f} % (limit {l:g} %)")
    return [
        f"{word}: {trial.indenter}, {day} {by}".rstrip(),
        *(
            line.format(
                what=c.name,
                a=c.value,
                b=c.truth,
                e=c.error_percent,
                l=c.limit_percent,
            )
            for c in trial.comparisons
        ),
    ]
