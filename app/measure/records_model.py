"""The lab's records: read and written in the background, with undo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoStack

from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.widgets.actions import UndoStep
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.store import Store
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, write_csv

RecordEdit = Callable[[Store], object]


class RecordsModel(QObject):
    """Reads and writes the records of the workspace in the background, with undo.

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
        Why something could not be read or written.
    """

    changed = Signal()
    noticed = Signal(str)

    def __init__(self, *, context: AppContext, parent: QObject) -> None:
        super().__init__(parent)
        self.undo = QUndoStack(self)
        self.records: tuple[MeasurementRecord, ...] = ()
        self._context = context
        self._jobs = JobQueue("records", self)
        self._jobs.refused.connect(self.noticed)
        self._folder: Path | None = None
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

    def add(self, record: MeasurementRecord, done: Callable[[int], object]) -> None:
        """Save a measurement. `done` is called with its number when it is on disk."""
        self.change("Saving the measurement", lambda records: records.add(record), done)

    def remove(self, numbers: tuple[int, ...]) -> None:
        """Remove measurements. This can be undone."""
        if numbers:
            self._push(
                f"remove {len(numbers)} measurements",
                lambda records: records.remove(*numbers),
                lambda records: records.restore(*numbers),
            )

    def write_note(self, record: MeasurementRecord, note: str) -> None:
        """Change the note of a measurement. This can be undone."""
        if note != record.note:
            self._push(
                "edit a note",
                lambda records: records.change(replace(record, note=note)),
                lambda records: records.change(record),
            )

    def _push(self, text: str, redo: RecordEdit, undo: RecordEdit) -> None:
        change = partial(self.change, "Changing the records")
        self.undo.push(UndoStep(text, partial(change, redo), partial(change, undo)))

    def export(self, path: Path, serial: str | None, done: Callable[[int], object]) -> None:
        """Write a table of all measurements, or of one sensor's."""

        def write(store: Store) -> int:
            records = store.all(MeasurementRecord, serial=serial)
            write_csv(records, path)
            return len(records)

        self.change("Writing the table", write, done)

    def close(self) -> None:
        """Finish the work in progress."""
        self._jobs.close()

    def change(
        self, title: str, change: RecordEdit, done: Callable[[int], object] | None = None
    ) -> None:
        """Change the records in the background. `done` is called with what `change` returns."""
        workspace = self._context.workspace
        folder = workspace.folder

        def work(_progress: object) -> tuple[object, tuple[MeasurementRecord, ...]]:
            records = workspace.records if workspace.folder == folder else None
            if records is None or records.path != folder / NAME:
                if change is _nothing:
                    return None, ()  # another job reads those of the other workspace
                raise InputError(
                    f"{title}: another workspace was chosen meanwhile",
                    folder,
                    "Choose the previous workspace and try again",
                )
            result = change(records)
            return result, records.all(MeasurementRecord)

        def finish(found: tuple[int, tuple[MeasurementRecord, ...]]) -> None:
            result, records = found
            if workspace.folder == folder:
                self._take(records)
            if done is not None:
                done(result)

        self._jobs.submit(BackgroundJob(title, work, finish, must=True))

    def _take(self, records: tuple[MeasurementRecord, ...]) -> None:
        if records != self.records:
            self.records = records
            self.changed.emit()


def _nothing(_records: Store) -> None:
    """Change nothing. The records are read."""
