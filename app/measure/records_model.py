"""The lab's records: read and written in the background, with undo."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from operator import attrgetter
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoStack

from app.program.context import AppContext
from app.program.jobs import BackgroundJob, JobQueue
from app.sources.source import SourceFrame
from app.widgets.actions import UndoStep
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.store import Store
from gelpolight_core.lab.measurement_record import FILE, MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME

RecordEdit = Callable[[Store], object]
Done = Callable[[int], object]


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

    def add(self, record: MeasurementRecord, done: Done, live: SourceFrame | None = None) -> None:
        """Save a measurement once. `done` is called with its number when it is on disk.

        The image of a camera becomes a file of the workspace. Recordings and folders have theirs.
        """

        def save(store: Store) -> int:
            return number_of(record, store.all(MeasurementRecord)) or store.add(with_image())

        def with_image() -> MeasurementRecord:
            if live is None or live.index is not None:
                return record
            file = self._context.workspace.keep_image(live.rgb, record.serial)
            return replace(record, settings={**record.settings, FILE: str(file)})

        self.change("Saving the measurement", save, done)

    def remove(self, numbers: tuple[int, ...]) -> None:
        """Remove measurements. This can be undone."""
        self._push(
            f"remove {len(numbers)} measurement{'s' * (len(numbers) > 1)}",
            lambda records: records.remove(*numbers),
            lambda records: records.restore(*numbers),
        )

    def write_note(self, record: MeasurementRecord, note: str) -> None:
        """Change the note of a measurement. This can be undone."""
        self._push(
            "edit a note",
            lambda records: records.change(replace(record, note=note)),
            lambda records: records.change(record),
        )

    def _push(self, text: str, redo: RecordEdit, undo: RecordEdit) -> None:
        change = partial(self.change, "Changing the records")
        self.undo.push(UndoStep(text, partial(change, redo), partial(change, undo)))

    def close(self) -> None:
        """Finish the work in progress."""
        self._jobs.close()

    def change(self, title: str, change: RecordEdit, done: Done | None = None) -> None:
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


def number_of(record: MeasurementRecord, saved: Iterable[MeasurementRecord]) -> int | None:
    """Return the number under which the same measurement is saved. None: it is not.

    Its image may have another name by now: a live image is kept as a file.
    """
    measured = attrgetter("serial", "calibration_id", "shape", "quantities")
    return next((other.id for other in saved if measured(other) == measured(record)), None)


def _nothing(_records: Store) -> None:
    """Change nothing. The records are read."""
