"""Writes a calibration's report beside the window's work."""

from __future__ import annotations

import logging
import threading
from pathlib import Path

from PySide6.QtCore import QObject, Qt, Signal

from app.sensors.details import trial_lines
from app.sources.stopping import join
from app.workspace.entries import Entry
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)


class ReportWriter(QObject):
    """One report at a time, in a thread of its own.

    Signals
    -------
    busy_changed(bool)
        Whether a report is being written.
    written(str)
        The file.
    refused(str)
        A sentence: why there is none.
    """

    busy_changed = Signal(bool)
    written = Signal(str)
    refused = Signal(str)
    _ended = Signal(str, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._thread: threading.Thread | None = None
        self._ended.connect(self._finish, Qt.ConnectionType.QueuedConnection)

    def write(self, entry: Entry, path: Path) -> None:
        """Begin to write the report of a calibration, HTML or PDF by its name's ending."""
        if self._thread is not None:
            return
        self._thread = threading.Thread(
            target=self._run, args=(entry, path), name="report", daemon=True
        )
        self._thread.start()
        self.busy_changed.emit(True)

    def stop(self) -> None:
        """Wait for a report that is being written."""
        if self._thread is not None:
            join(self._thread)

    def _run(self, entry: Entry, path: Path) -> None:
        refusal = ""
        try:
            write_entry_report(entry, path)
        except InputError as error:
            refusal = str(error)
        except Exception as error:  # told in the window, whole in the log
            _LOG.exception("The report failed")
            refusal = tr("A fault of this program ({kind}); the log has it.").format(
                kind=type(error).__name__
            )
        self._ended.emit(str(path), refusal)

    def _finish(self, path: str, refusal: str) -> None:
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.busy_changed.emit(False)
        if refusal:
            self.refused.emit(refusal)
        else:
            self.written.emit(path)


def write_entry_report(entry: Entry, path: Path) -> None:
    """Write the report of a calibration of the library, with the trial kept beside it.

    Raises
    ------
    InputError
        If the calibration cannot be read or the file cannot be written.
    """
    from gelpolight_core.calibration.file import read_calibration  # heavy, all of them
    from gelpolight_core.report.build import calibration_report
    from gelpolight_core.report.document import Validation
    from gelpolight_core.report.file import refuse_other_endings, write_report

    refuse_other_endings(path)
    said = trial_lines(entry)
    validation = Validation("; ".join(said)) if entry.validation is not None else None
    write_report(calibration_report(read_calibration(entry.path), validation=validation), path)
