"""The lab's records: read and written in the background, with undo."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoStack

from app.context.context import AppContext
from app.services.jobs import Job, Jobs
from app.widgets.undo import UndoStep
from gelpolight_core.errors import InputError
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.records.records import NAME, Records
from gelpolight_core.sensor_calibration import Calibration

Change = Callable[[Records], object]


class RecordBook(QObject):
    """The records of the workspace.

    Attributes
    ----------
    undo : QUndoStack
        History of removals and notes.
    records : tuple of MeasurementRecord
        All records, oldest first.

    Signals
    -------
    changed()
        `records` changed.
    noticed(str)
        Why something could not be read or written, or what happened to the file.
    """

    changed = Signal()
    noticed = Signal(str)

    def __init__(self, *, context: AppContext, parent: QObject) -> None:
        super().__init__(parent)
        self.undo = QUndoStack(self)
        self.records: tuple[MeasurementRecord, ...] = ()
        self._context = context
        self._jobs = Jobs("records", self)
        self._jobs.refused.connect(self.noticed)
        self._folder: Path | None = None
        self._reported = ""
        context.requests.calibrations_changed.connect(self._on_workspace)

    @property
    def busy(self) -> bool:
        """Whether a job is reading or writing."""
        return self._jobs.busy

    def refresh(self) -> None:
        """Read the records, of another workspace if one was chosen meanwhile."""
        folder = self._context.workspace.folder
        if folder != self._folder:
            self._folder = folder
            self.undo.clear()
            self._take(())  # record numbers of the other workspace have another meaning here
        if (folder / NAME).exists():
            self.change("Reading the records", _nothing)
        else:
            self._take(())

    def _on_workspace(self) -> None:
        if self._folder not in (None, self._context.workspace.folder):
            self.refresh()

    def add(
        self,
        record: MeasurementRecord,
        done: Callable[[int], object],
        *,
        calibration: Calibration | None = None,
    ) -> None:
        """Save a measurement and the description of its calibration.

        `done` is called with its number when it is on disk.
        """

        def keep(records: Records) -> int:
            number = records.add(record)
            if calibration is not None and calibration.identity == record.calibration_id:
                records.know_calibration(
                    calibration.identity,
                    record.serial,
                    model=calibration.model,
                    made=calibration.provenance.created,
                    verdict=calibration.verdict.value,
                )
            return number

        self.change("Saving the measurement", keep, done)

    def remove(self, numbers: tuple[int, ...]) -> None:
        """Remove measurements. This can be undone."""
        if numbers:
            text = f"remove {len(numbers)} measurements"
            self._push(
                text,
                partial(_each, Records.remove, numbers),
                partial(_each, Records.restore, numbers),
            )

    def write_note(self, number: int, note: str) -> None:
        """Change the note of a measurement. This can be undone."""
        before = next((r.note for r in self.records if r.id == number), "")
        if note != before:
            self._push(
                "edit a note",
                lambda records: records.update_note(number, note),
                lambda records: records.update_note(number, before),
            )

    def _push(self, text: str, redo: Change, undo: Change) -> None:
        change = partial(self.change, "Changing the records")
        self.undo.push(UndoStep(text, partial(change, redo), partial(change, undo)))

    def export(self, path: Path, serial: str | None, done: Callable[[int], object]) -> None:
        """Write a table of all measurements, or of those of one sensor."""
        self.change("Writing the table", lambda records: records.export_csv(path, serial), done)

    def close(self) -> None:
        """Finish the work in progress."""
        self._jobs.close()

    def change(
        self, title: str, change: Change, done: Callable[[int], object] | None = None
    ) -> None:
        """Change the records in the background. `done` is called with what `change` returns."""
        workspace = self._context.workspace
        folder = workspace.folder

        def work(_progress: object) -> tuple[object, tuple[MeasurementRecord, ...], str]:
            records = workspace.records if workspace.folder == folder else None
            if records is None or records.path != folder / NAME:
                if change is _nothing:
                    return None, (), ""  # another job reads those of the other workspace
                raise InputError(
                    f"{title}: another workspace was chosen meanwhile",
                    folder,
                    "Choose the previous workspace and try again",
                )
            result = change(records)
            return result, records.measurements(), records.notice

        def finish(found: tuple[int, tuple[MeasurementRecord, ...], str]) -> None:
            result, records, notice = found
            if notice and notice != self._reported:
                self._reported = notice
                self.noticed.emit(notice)
            if workspace.folder == folder:
                self._take(records)
            if done is not None:
                done(result)

        self._jobs.submit(Job(title, work, finish, must=True))

    def _take(self, records: tuple[MeasurementRecord, ...]) -> None:
        if records != self.records:
            self.records = records
            self.changed.emit()


def _nothing(_records: Records) -> None:
    """Change nothing. The records are read."""


def _each(
    change: Callable[[Records, int], None], numbers: tuple[int, ...], records: Records
) -> None:
    for number in numbers:
        change(records, number)
