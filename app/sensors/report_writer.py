"""Writes a calibration's report in the background."""

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
    """Writes one report at a time, in its own thread.

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
        """Start writing the report of a calibration, HTML or PDF by the file extension."""
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
        except Exception as error:  # short message in the window, full traceback in the log
            _LOG.exception("The report failed")
            refusal = tr("Internal error ({kind}). See the log for details.").format(
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
