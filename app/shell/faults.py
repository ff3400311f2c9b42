"""Faults of the program: each into the log, one message to the person, never a silent death."""

from __future__ import annotations

import logging
import sys
import threading
from types import TracebackType
from typing import Any

from PySide6.QtCore import (
    QMessageLogContext,
    QObject,
    QtMsgType,
    Signal,
    Slot,
    qInstallMessageHandler,
)

from app.shell.toasts import Toasts
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

log = logging.getLogger(__name__)

QT_LEVELS = {
    QtMsgType.QtDebugMsg: logging.DEBUG,
    QtMsgType.QtInfoMsg: logging.INFO,
    QtMsgType.QtWarningMsg: logging.WARNING,
    QtMsgType.QtCriticalMsg: logging.ERROR,
    QtMsgType.QtFatalMsg: logging.CRITICAL,
}


class Faults(QObject):
    """Takes what nobody caught, in any thread.

    Parameters
    ----------
    toasts : Toasts
        Where the person is told.
    """

    _told = Signal(str, bool)  # from any thread; Qt brings it into the window's

    def __init__(self, toasts: Toasts) -> None:
        super().__init__()
        self._toasts = toasts
        self._before: tuple[Any, ...] = ()
        self._told.connect(self._tell)

    def install(self) -> None:
        """Take over Python's and Qt's last resorts."""
        self._before = (sys.excepthook, threading.excepthook, sys.unraisablehook)
        sys.excepthook = self.take
        threading.excepthook = self._take_from_thread
        sys.unraisablehook = self._take_unraisable
        qInstallMessageHandler(_log_qt)

    def uninstall(self) -> None:
        """Give them back."""
        sys.excepthook, threading.excepthook, sys.unraisablehook = self._before
        qInstallMessageHandler(None)

    def take(
        self,
        kind: type[BaseException],
        error: BaseException,
        trace: TracebackType | None = None,
        where: str = "",
    ) -> None:
        """Log a fault and tell the person once; an InputError is told as it is."""
        if isinstance(error, InputError):
            log.warning("%s", error, exc_info=(kind, error, trace))
            self._told.emit(str(error), False)
            return
        log.critical("Fault%s", where and f" in {where}", exc_info=(kind, error, trace))
        lines = str(error).splitlines()
        what = lines[0] if lines else kind.__name__
        said = tr("A fault of this program ({what}); please report it with the log")
        self._told.emit(said.format(what=what) + ".", True)

    def _take_from_thread(self, given: threading.ExceptHookArgs) -> None:
        name = "" if given.thread is None else given.thread.name
        error = given.exc_value or given.exc_type()
        self.take(given.exc_type, error, given.exc_traceback, name)

    def _take_unraisable(self, given: Any) -> None:
        error = given.exc_value or given.exc_type()
        self.take(given.exc_type, error, given.exc_traceback, given.err_msg or "")

    @Slot(str, bool)
    def _tell(self, text: str, with_log: bool) -> None:
        self._toasts.show(text, "fail", with_log=with_log)


def _log_qt(kind: QtMsgType, context: QMessageLogContext, text: str) -> None:
    logging.getLogger("qt").log(QT_LEVELS.get(kind, logging.WARNING), "%s", text)
