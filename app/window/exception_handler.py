"""Internal errors: each is logged and shown to the user in one message."""

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

from app.program.toasts import Toasts
from gelpolight_core.base.errors import as_input_error

log = logging.getLogger(__name__)

QT_LEVELS = {
    QtMsgType.QtDebugMsg: logging.DEBUG,
    QtMsgType.QtInfoMsg: logging.INFO,
    QtMsgType.QtWarningMsg: logging.WARNING,
    QtMsgType.QtCriticalMsg: logging.ERROR,
    QtMsgType.QtFatalMsg: logging.CRITICAL,
}


class ExceptionHandler(QObject):
    """Handles exceptions that nothing else caught, in any thread.

    Parameters
    ----------
    toasts : Toasts
        Shows the message to the user.
    """

    _reported = Signal(str, bool)  # from any thread; Qt delivers it in the window's thread

    def __init__(self, toasts: Toasts) -> None:
        super().__init__()
        self._toasts = toasts
        self._before: tuple[Any, ...] = ()
        self._reported.connect(self._report)

    def install(self) -> None:
        """Install the handlers of Python and Qt for uncaught exceptions and messages."""
        self._before = (sys.excepthook, threading.excepthook, sys.unraisablehook)
        sys.excepthook = self.take
        threading.excepthook = self._take_from_thread
        sys.unraisablehook = self._take_unraisable
        qInstallMessageHandler(_log_qt)

    def uninstall(self) -> None:
        """Restore the previous handlers."""
        sys.excepthook, threading.excepthook, sys.unraisablehook = self._before
        qInstallMessageHandler(None)

    def take(
        self,
        kind: type[BaseException],
        error: BaseException,
        trace: TracebackType | None = None,
        where: str = "",
    ) -> None:
        """Log an error and show it once. The sentence of an InputError is shown unchanged."""
        if fault := as_input_error(error):
            log.warning("%s", fault, exc_info=(kind, error, trace))
            self._reported.emit(str(fault), False)
            return
        log.critical("Internal error%s", where and f" in {where}", exc_info=(kind, error, trace))
        lines = str(error).splitlines()
        what = lines[0] if lines else kind.__name__
        message = f"Internal error ({what}). Please report it and include the log."
        self._reported.emit(message, True)

    def _take_from_thread(self, given: threading.ExceptHookArgs) -> None:
        name = "" if given.thread is None else given.thread.name
        error = given.exc_value or given.exc_type()
        self.take(given.exc_type, error, given.exc_traceback, name)

    def _take_unraisable(self, given: Any) -> None:
        error = given.exc_value or given.exc_type()
        self.take(given.exc_type, error, given.exc_traceback, given.err_msg or "")

    @Slot(str, bool)
    def _report(self, text: str, with_log: bool) -> None:
        self._toasts.show(text, "fail", with_log=with_log)


def _log_qt(kind: QtMsgType, context: QMessageLogContext, text: str) -> None:
    logging.getLogger("qt").log(QT_LEVELS.get(kind, logging.WARNING), "%s", text)
