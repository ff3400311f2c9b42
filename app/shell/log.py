"""The log: a file that is kept small, and the last records for the log window."""

from __future__ import annotations

import contextlib
import faulthandler
import logging
import tempfile
from collections import deque
from dataclasses import dataclass
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TextIO

import platformdirs

from gelpolight_core import __version__

NAME = "gelpolight.log"
CRASHES = "gelpolight-crash.log"
FILE_BYTES = 1_000_000
FILES = 5
KEPT = 5000
OURS = ("app", "gelpolight_core")
LINE = "%(asctime)s %(levelname)-7s %(threadName)s %(name)s: %(message)s"


@dataclass(frozen=True, slots=True)
class Record:
    """One line of the log, with its place in the order."""

    number: int
    level: int
    text: str


def worth_keeping(record: logging.LogRecord) -> bool:
    """Return whether a record is ours, or at least a warning: libraries tell every step."""
    return record.levelno >= logging.WARNING or record.name.partition(".")[0] in OURS


class RecentRecords(logging.Handler):
    """Keeps the last records; may be read from any thread."""

    def __init__(self) -> None:
        super().__init__(logging.DEBUG)
        self.setFormatter(logging.Formatter(LINE))
        self._records: deque[Record] = deque(maxlen=KEPT)
        self._count = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a record; called under the handler's lock."""
        self._count += 1
        self._records.append(Record(self._count, record.levelno, self.format(record)))

    def since(self, number: int) -> tuple[Record, ...]:
        """Return the kept records after the one with that number."""
        self.acquire()
        try:
            return tuple(r for r in self._records if r.number > number)
        finally:
            self.release()


class Log:
    """The log of one run of the program.

    Parameters
    ----------
    folder : Path, optional
        Where the files are; the user's log folder without it, the temporary one where that cannot
        be written.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.recent = RecentRecords()
        self.folder, self._file = _open_file(folder)
        self._crashes: TextIO | None = None
        self._level_before = logging.WARNING

    def start(self) -> str:
        """Begin to log, and return what a crash of the last run left behind."""
        root = logging.getLogger()
        self._level_before = root.level
        root.setLevel(logging.INFO)
        for handler in (self.recent, self._file):
            handler.addFilter(worth_keeping)
            root.addHandler(handler)
        logging.captureWarnings(True)
        crash = self.folder / CRASHES
        left = ""
        try:
            left = crash.read_text("utf-8", "replace") if crash.is_file() else ""
            # A crash inside a library cannot be caught; its place can be written down.
            self._crashes = crash.open("w", encoding="utf-8")
            faulthandler.enable(self._crashes)
        except OSError as error:  # the program runs all the same
            logging.getLogger(__name__).warning("Crashes are not written down: %s", error)
        if left:
            logging.getLogger(__name__).error("The last run ended in a crash:\n%s", left)
        logging.getLogger(__name__).info("GelPoLight Studio %s starts", __version__)
        return left

    def stop(self) -> None:
        """End the log."""
        root = logging.getLogger()
        logging.captureWarnings(False)
        root.removeHandler(self.recent)
        root.removeHandler(self._file)
        root.setLevel(self._level_before)
        with contextlib.suppress(OSError):  # of a full disk all was told that can be
            self._file.close()
        if self._crashes is not None:
            faulthandler.disable()
            self._crashes.close()
            self._crashes = None


def _open_file(folder: Path | None) -> tuple[Path, logging.Handler]:
    wanted = folder or platformdirs.user_log_path("gelpolight")
    # A full disk, a home that can only be read: then the temporary folder, or no file at all.
    with contextlib.suppress(OSError):
        return wanted, _handler(wanted)
    with contextlib.suppress(OSError):
        spare = Path(tempfile.mkdtemp(prefix="gelpolight-log-"))
        return spare, _handler(spare)
    return wanted, logging.NullHandler()


def _handler(folder: Path) -> RotatingFileHandler:
    folder.mkdir(parents=True, exist_ok=True)
    handler = RotatingFileHandler(
        folder / NAME, maxBytes=FILE_BYTES, backupCount=FILES, encoding="utf-8"
    )
    handler.setFormatter(logging.Formatter(LINE))
    return handler
