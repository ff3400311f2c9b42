"""The desktop program: one application, one window, and errors that nothing else caught."""

from __future__ import annotations

import ctypes
import gc
import locale
import logging
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes.util import find_library
from pathlib import Path
from types import TracebackType
from typing import Any

from PySide6.QtCore import (
    QCoreApplication,
    QMessageLogContext,
    QObject,
    QSocketNotifier,
    Qt,
    QTimer,
    QtMsgType,
    Signal,
    Slot,
    qInstallMessageHandler,
)
from PySide6.QtGui import QGuiApplication, QSurfaceFormat
from PySide6.QtWidgets import QApplication

from app.program.camera_manager import CameraManager
from app.program.context import AppContext, PageRequests, SourceSelection
from app.program.display import DisplayStore
from app.program.log import Log
from app.program.opengl import surface_format
from app.program.preferences import APPLICATION
from app.program.settings import AppSettings
from app.program.status import StatusModel
from app.program.toasts import Toasts
from app.program.workspace import Workspace
from app.sources.stoppable_thread import join_unfinished_threads
from app.widgets import theme
from app.widgets.icons import application_icon
from gelpolight_core.base.errors import InputError, as_input_error
from gelpolight_core.base.version import __version__
from gelpolight_core.output.recording.recording_format import ENDING as RECORDING_ENDING

from .main_window import SOURCES, MainWindow
from .malloc_cache import limit_malloc_cache

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


# The first page is drawn and responds before slow modules are loaded in the background.
FIRST_LOOK_MS = 300
# The first depth of a live page and its 3D view are not delayed by what other pages need.
FIRST_VIEW_MS = 10_000
# Longer than any single call of a stage or a renderer.
LAST_JOIN_S = 10.0


def run(arguments: Sequence[str] = ()) -> int:
    """Show the main window until it is closed.

    Parameters
    ----------
    arguments : sequence of str
        ``--demo`` shows the virtual sensor. Anything else is a file to open.

    Returns
    -------
    status : int
        Exit status.

    Raises
    ------
    InputError
        If no display is available.
    """
    with screen():
        application = make_application()
    context = make_context()
    crash = context.log.start()
    faults = ExceptionHandler(context.toasts)
    faults.install()
    # Modules are no garbage: looking for it while they are loaded takes a tenth of the start.
    gc.disable()
    try:
        theme.apply(application, context.settings.preferences.theme)
        window = MainWindow(context=context)
        demo = "--demo" in arguments
        can_inspect = demo or context.workspace.in_use is not None
        window.show_page("inspect" if can_inspect else "start")
        window.show()
        if demo:
            QTimer.singleShot(0, lambda: window.begin("demo"))  # after the window is visible
        elif arguments:
            open_files(window, [Path(argument) for argument in arguments])
        if crash:
            context.toasts.show(
                "The program crashed in its last run. See the log for details.",
                "warn",
                with_log=True,
            )
        stop_listening = _close_on_signals(window)
        modules = [name for entry in window.entries.values() for name in entry.modules]

        def go_on() -> None:
            window.choose_source_again()
            wait_ms = 0 if window.page_name == "start" else FIRST_VIEW_MS
            QTimer.singleShot(wait_ms, window.loader, gc.enable)
            QTimer.singleShot(wait_ms, window.loader, lambda: window.loader.load(modules))

        QTimer.singleShot(FIRST_LOOK_MS, window.loader, go_on)
        status = application.exec()
        stop_listening()
        ended = join_unfinished_threads(LAST_JOIN_S)
    finally:
        gc.enable()
        faults.uninstall()
        context.workspace.close()
        context.log.stop()
    if not ended:
        sys.stdout.flush()
        os._exit(status)
    return status


def open_files(window: MainWindow, files: Sequence[Path]) -> None:
    """Open files from the desktop as if they were dropped. A recording is played at once."""

    def go_on() -> None:
        window.open_dropped(tuple(files))
        if any(file.suffix.lower() == RECORDING_ENDING for file in files):
            window.show_page("inspect")

    window.loader.when_loaded(SOURCES, go_on)


@contextmanager
def screen() -> Iterator[None]:
    """Raise an InputError where Qt would abort: no display, or one that does not respond.

    The connection to the display stays open while Qt opens its own. An X server without a desktop
    restarts when its last client disconnects, and accepts no connection meanwhile.

    Raises
    ------
    InputError
        If no display is available.
    """
    display = os.environ.get("DISPLAY", "")
    other = os.environ.get("QT_QPA_PLATFORM") or os.environ.get("WAYLAND_DISPLAY")
    if other or not sys.platform.startswith("linux"):
        yield
        return
    with _connection(display) as answers:
        if not answers:
            raise InputError(
                "No display is available for a window",
                f"DISPLAY={display}",
                (
                    "Start the program on a desktop, use ssh -X, or use the commands that "
                    "need no display (gelpolight --help)"
                ),
            )
        yield


@contextmanager
def _connection(display: str) -> Iterator[bool]:
    """Connect to an X server and return whether it answers, or True if that is unknown."""
    name = find_library("xcb")
    if not display or name is None:
        yield bool(display)
        return
    xcb = ctypes.CDLL(name)
    xcb.xcb_connect.restype = ctypes.c_void_p
    xcb.xcb_connect.argtypes = [ctypes.c_char_p, ctypes.c_void_p]
    xcb.xcb_connection_has_error.argtypes = [ctypes.c_void_p]
    xcb.xcb_disconnect.argtypes = [ctypes.c_void_p]
    connection = xcb.xcb_connect(display.encode(), None)
    try:
        yield not xcb.xcb_connection_has_error(connection)
    finally:
        xcb.xcb_disconnect(connection)


def make_application() -> QApplication:
    """Return the application, with the options that must be set before it is created."""
    before = QApplication.instance()
    if isinstance(before, QApplication):
        return before
    limit_malloc_cache()
    QGuiApplication.setHighDpiScaleFactorRoundingPolicy(
        Qt.HighDpiScaleFactorRoundingPolicy.PassThrough
    )
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    # The 3D view has a native window. Its neighbours need none.
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_DontCreateNativeWidgetSiblings)
    QSurfaceFormat.setDefaultFormat(surface_format())
    application = QApplication(sys.argv[:1])
    # Qt has set the system's: C libraries would then write, and expect, a decimal comma.
    locale.setlocale(locale.LC_NUMERIC, "C")
    application.setApplicationName(APPLICATION)
    application.setApplicationDisplayName("GelPoLight Studio")
    application.setApplicationVersion(__version__)
    application.setDesktopFileName("gelpolight")
    application.setWindowIcon(application_icon())
    return application


def make_context(
    *, settings_file: Path | None = None, log_folder: Path | None = None
) -> AppContext:
    """Return what all pages share.

    Parameters
    ----------
    settings_file, log_folder : Path, optional
        Used instead of the user's own folders.
    """
    settings = AppSettings(settings_file)
    status, toasts = StatusModel(), Toasts()
    return AppContext(
        settings=settings,
        display=DisplayStore(settings),
        workspace=Workspace(settings.workspace_folder),
        status=status,
        toasts=toasts,
        source=SourceSelection(),
        requests=PageRequests(),
        log=Log(log_folder),
        cameras=CameraManager(settings=settings, status=status, toasts=toasts),
    )


def _close_on_signals(window: MainWindow) -> Callable[[], None]:
    """Close the window on Ctrl-C and on the system's termination signal. Return an undo function.

    Qt's event loop runs no Python code by itself: the signal writes into a socket that Qt watches.
    """
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    before_fd = signal.set_wakeup_fd(writer.fileno())
    # A handler runs inside any Python code, such as a paint event, which must not end the window.
    before = {
        number: signal.signal(number, lambda *_: None) for number in (signal.SIGINT, signal.SIGTERM)
    }
    notifier = QSocketNotifier(reader.fileno(), QSocketNotifier.Type.Read)
    notifier.activated.connect(lambda *_: reader.recv(64) and window.close())

    def undo() -> None:
        notifier.setEnabled(False)
        signal.set_wakeup_fd(before_fd)
        for number, handler in before.items():
            signal.signal(number, handler)
        reader.close()
        writer.close()

    return undo
