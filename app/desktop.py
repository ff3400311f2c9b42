"""The desktop program: one application, one window."""

from __future__ import annotations

import ctypes
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

from app.cameras.desk import CameraDesk
from app.shell import theme
from app.shell.context import AppContext, Requests, SourceChoice
from app.shell.faults import Faults
from app.shell.icons import application_icon
from app.shell.log import Log
from app.shell.main_window import SOURCES, MainWindow
from app.shell.memory import keep_little
from app.shell.settings import APPLICATION, Settings
from app.shell.status import StatusModel
from app.shell.toasts import Toasts
from app.sources.stopping import join_left_behind
from app.workspace.workspace import Workspace
from gelpolight_core import __version__
from gelpolight_core.errors import InputError
from gelpolight_core.recording.recording import ENDING as RECORDING_ENDING
from gelpolight_core.translation import tr

# The first page is drawn and answers before anything heavy is loaded beside it.
FIRST_LOOK_MS = 300
# Longer than any single call of a stage or a renderer takes.
LAST_JOIN_S = 10.0


def run(arguments: Sequence[str] = ()) -> int:
    """Show the main window until it is closed.

    Parameters
    ----------
    arguments : sequence of str
        ``--demo`` puts the virtual sensor in as the source; anything else is a file to open.

    Returns
    -------
    status : int
        Exit status.

    Raises
    ------
    InputError
        If there is no screen to show a window on.
    """
    with screen():
        application = make_application()
    context = make_context()
    crash = context.log.start()
    faults = Faults(context.toasts)
    faults.install()
    try:
        theme.apply(application, context.settings.theme)
        window = MainWindow(context=context)
        window.show_page(context.settings.last_page)
        window.show()
        if "--demo" in arguments:
            QTimer.singleShot(0, window.begin_demo)  # after the window is up
        elif arguments:
            open_files(window, [Path(argument) for argument in arguments])
        if crash:
            context.toasts.show(
                tr("The program ended in a crash last time; the log says where."),
                "warn",
                with_log=True,
            )
        stop_listening = _close_on_signals(window)
        modules = [name for entry in window.entries.values() for name in entry.modules]

        def go_on() -> None:
            window.choose_source_again()
            window.loader.load(modules)

        QTimer.singleShot(FIRST_LOOK_MS, window.loader, go_on)
        status = application.exec()
        stop_listening()
        ended = join_left_behind(LAST_JOIN_S)
    finally:
        faults.uninstall()
        context.workspace.close()
        context.log.stop()
    if not ended:
        sys.stdout.flush()
        os._exit(status)
    return status


def open_files(window: MainWindow, files: Sequence[Path]) -> None:
    """Open what a desktop hands over, as if it were dropped; a recording is played at once."""

    def go_on() -> None:
        window.open_dropped(tuple(files))
        if any(file.suffix.lower() == RECORDING_ENDING for file in files):
            window.show_page("inspect")

    window.loader.when_loaded(SOURCES, go_on)


@contextmanager
def screen() -> Iterator[None]:
    """Refuse in one sentence where Qt would abort: no display, or one that does not answer.

    The display is held while Qt makes its own connection: a server without a desktop starts anew
    when its last guest leaves, and takes nobody in meanwhile.

    Raises
    ------
    InputError
        If there is no screen to show a window on.
    """
    display = os.environ.get("DISPLAY", "")
    other = os.environ.get("QT_QPA_PLATFORM") or os.environ.get("WAYLAND_DISPLAY")
    if other or not sys.platform.startswith("linux"):
        yield
        return
    with _connection(display) as answers:
        if not answers:
            raise InputError(
                tr("there is no screen to show a window on"),
                where=f"DISPLAY={display}",
                advice=tr(
                    "Start it on a desktop, use ssh -X, or use the commands, which need no screen "
                    "(gelpolight --help)"
                ),
            )
        yield


@contextmanager
def _connection(display: str) -> Iterator[bool]:
    """Connect to an X server; whether it answers, True where that cannot be asked."""
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
    """Return the application, made with what must be set before it exists."""
    before = QApplication.instance()
    if isinstance(before, QApplication):
        return before
    keep_little()
    QGuiApplication.setHighDpiScaleFactorRoundingPolicy(
        Qt.HighDpiScaleFactorRoundingPolicy.PassThrough
    )
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    # The 3D view is loaded late; a format set then would make Qt build the window anew.
    surface = QSurfaceFormat()
    surface.setVersion(3, 2)
    surface.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    surface.setDepthBufferSize(24)
    QSurfaceFormat.setDefaultFormat(surface)
    application = QApplication(sys.argv[:1])
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
        Elsewhere than in the user's own folders.
    """
    settings = Settings(settings_file)
    status, toasts = StatusModel(), Toasts()
    return AppContext(
        settings=settings,
        workspace=Workspace(settings.workspace_folder),
        status=status,
        toasts=toasts,
        source=SourceChoice(),
        requests=Requests(),
        log=Log(log_folder),
        cameras=CameraDesk(settings=settings, status=status, toasts=toasts),
    )


def _close_on_signals(window: MainWindow) -> Callable[[], None]:
    """Close the window on Ctrl-C and on the system's request to end; return how to undo that.

    Qt's loop runs no Python by itself: the signal writes into a socket on which Qt listens.
    """
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    before_fd = signal.set_wakeup_fd(theirs.fileno())
    before = {
        number: signal.signal(number, lambda *_: window.close())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    notifier = QSocketNotifier(ours.fileno(), QSocketNotifier.Type.Read)
    notifier.activated.connect(lambda *_: ours.recv(64))

    def undo() -> None:
        notifier.setEnabled(False)
        signal.set_wakeup_fd(before_fd)
        for number, handler in before.items():
            signal.signal(number, handler)
        ours.close()
        theirs.close()

    return undo
