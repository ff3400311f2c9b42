"""The desktop program: one application, one window."""

from __future__ import annotations

import ctypes
import gc
import locale
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes.util import find_library
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QSocketNotifier, Qt, QTimer
from PySide6.QtGui import QGuiApplication, QSurfaceFormat
from PySide6.QtWidgets import QApplication

from app.program.camera_manager import CameraManager
from app.program.context import AppContext, PageRequests, SourceSelection
from app.program.display import DisplayStore
from app.program.log import Log
from app.program.opengl import surface_format
from app.program.settings import AppSettings
from app.program.status import StatusModel
from app.program.stored_settings import APPLICATION
from app.program.toasts import Toasts
from app.program.workspace import Workspace
from app.sources.stoppable_thread import join_unfinished_threads
from app.widgets import theme
from app.widgets.icons import application_icon
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.version import __version__
from gelpolight_core.output.recording.recording_format import ENDING as RECORDING_ENDING

from .exception_handler import ExceptionHandler
from .main_window import SOURCES, MainWindow
from .malloc_cache import limit_malloc_cache

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
