"""The desktop program: one application, one window."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtGui import QGuiApplication, QSurfaceFormat
from PySide6.QtWidgets import QApplication

from app.shell import theme
from app.shell.context import AppContext, Requests, SourceChoice
from app.shell.icons import application_icon
from app.shell.main_window import MainWindow
from app.shell.settings import APPLICATION, Settings
from app.shell.status import StatusModel
from app.shell.toasts import Toasts
from app.workspace.workspace import Workspace
from gelpolight_core import __version__


def make_application() -> QApplication:
    """Return the application, made with what must be set before it exists."""
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
    application = QApplication.instance() or QApplication(sys.argv[:1])
    application.setApplicationName(APPLICATION)
    application.setApplicationDisplayName("GelPoLight Studio")
    application.setApplicationVersion(__version__)
    application.setDesktopFileName("gelpolight")
    application.setWindowIcon(application_icon())
    return application


def make_context(*, demo: bool = False) -> AppContext:
    """Return what all pages share."""
    settings = Settings()
    return AppContext(
        settings=settings,
        workspace=Workspace(settings.workspace_folder),
        status=StatusModel(),
        toasts=Toasts(),
        source=SourceChoice(),
        requests=Requests(),
        demo=demo,
    )


def run(arguments: Sequence[str] = ()) -> int:
    """Show the main window until it is closed; return the exit status."""
    application = make_application()
    context = make_context(demo="--demo" in arguments)
    theme.apply(application, context.settings.theme)
    window = MainWindow(context=context)
    names = list(window.entries)
    last = context.settings.last_page
    window.show_page(last if last in names else names[0])
    window.resize(1280, 800)
    window.show()
    return application.exec()
