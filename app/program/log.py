"""The log: a file of limited size."""

from __future__ import annotations

import contextlib
import faulthandler
import logging
import tempfile
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TextIO

import platformdirs

from gelpolight_core.base.version import __version__

NAME = "gelpolight.log"
CRASHES = "gelpolight-crash.log"
OURS = ("app", "gelpolight_core")
LINE = "%(asctime)s %(levelname)-7s %(threadName)s %(name)s: %(message)s"


def worth_keeping(record: logging.LogRecord) -> bool:
    """Return whether to keep a record: all of ours, but only warnings and errors of libraries."""
    return record.levelno >= logging.WARNING or record.name.partition(".")[0] in OURS


class Log:
    """The log of one run of the program.

    Parameters
    ----------
    folder : Path, optional
        Folder of the log files. Default: the user's log folder, or the temporary folder if that is
        not writable.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder, self._file = _open_file(folder)
        self._crashes: TextIO | None = None
        self._level_before = logging.WARNING

    def start(self) -> str:
        """Start logging, and return the crash report that the last run left, if any."""
        root = logging.getLogger()
        self._level_before = root.level
        root.setLevel(logging.INFO)
        self._file.addFilter(worth_keeping)
        root.addHandler(self._file)
        logging.captureWarnings(True)
        crash = self.folder / CRASHES
        crash_report = ""
        try:
            crash_report = crash.read_text("utf-8", "replace") if crash.is_file() else ""
            # A crash inside a library cannot be caught, but its stack can be written to a file.
            self._crashes = crash.open("w", encoding="utf-8")
            faulthandler.enable(self._crashes)
        except OSError as error:  # the program runs without it
            logging.getLogger(__name__).warning("Crash reports are off: %s", error)
        if crash_report:
            logging.getLogger(__name__).error("The last run crashed:\n%s", crash_report)
        logging.getLogger(__name__).info("GelPoLight Studio %s starts", __version__)
        return crash_report

    def stop(self) -> None:
        """Close the log."""
        root = logging.getLogger()
        logging.captureWarnings(False)
        root.removeHandler(self._file)
        root.setLevel(self._level_before)
        with contextlib.suppress(OSError):  # a full disk was already reported
            self._file.close()
        if self._crashes is not None:
            faulthandler.disable()
            self._crashes.close()
            self._crashes = None


def _open_file(folder: Path | None) -> tuple[Path, logging.Handler]:
    log_folder = folder or platformdirs.user_log_path("gelpolight")
    # If the disk is full or the home folder is read-only, use the temporary folder, or no file.
    with contextlib.suppress(OSError):
        return log_folder, _handler(log_folder)
    with contextlib.suppress(OSError):
        temporary = Path(tempfile.mkdtemp(prefix="gelpolight-log-"))
        return temporary, _handler(temporary)
    return log_folder, logging.NullHandler()


def _handler(folder: Path) -> RotatingFileHandler:
    folder.mkdir(parents=True, exist_ok=True)
    handler = RotatingFileHandler(
        folder / NAME, maxBytes=1_000_000, backupCount=5, encoding="utf-8"
    )
    handler.setFormatter(logging.Formatter(LINE))
    return handler
