"""Walk through every page of the program at several sizes, and print what cannot be reached.

Run as a program it takes a folder for its files. `QT_SCALE_FACTOR` enlarges everything.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from layout_check import faults
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QTabWidget

from app.program.context import AppContext
from app.window.main_window import MainWindow

SIZES = ((1024, 700), (1280, 800), (1366, 768), (1920, 1080))
SETTLE_MS = 30


def walk(context: AppContext, sizes: tuple[tuple[int, int], ...] = SIZES) -> Iterator[str]:
    """Find the faults of all pages, of the tabs of Measure, and of all steps of the wizard."""
    window = MainWindow(context=context)
    window.showNormal()  # also on a small screen
    for name in window.entries:
        page = window.page(name)  # made here, without its loading view
        window.show_page(name)
        if name == "calibrate":
            yield from _wizard(window, context, sizes)
        else:
            yield from _at_sizes(window, name, sizes)
        for tabs in page.findChildren(QTabWidget, "measure.tabs"):
            for index in range(1, tabs.count()):
                tabs.setCurrentIndex(index)
                yield from _at_sizes(window, f"{name}, tab {index}", sizes)
    window.close()
    window.deleteLater()


def _wizard(
    window: MainWindow, context: AppContext, sizes: tuple[tuple[int, int], ...]
) -> Iterator[str]:
    from app.source_ui.virtual_session import virtual_session
    from gelpolight_core.session.description import create_session

    page = window.page("calibrate")
    yield from _at_sizes(window, "calibrate", sizes)
    page.begin()
    yield from _at_sizes(window, "set-up of a new sensor", sizes)
    folder = context.workspace.sessions_folder("A-001") / "2026-01-02"
    create_session(replace(virtual_session(), folder=folder))
    page.open_path(folder)
    for step in page.wizard.steps:
        page.wizard.go_to(step.key)
        yield from _at_sizes(window, f"step {step.key}", sizes[:1])


def _at_sizes(window: MainWindow, name: str, sizes: tuple[tuple[int, int], ...]) -> Iterator[str]:
    for width, height in sizes:
        window.resize(width, height)
        QTest.qWait(SETTLE_MS)
        if (window.width(), window.height()) != (width, height):
            yield f"{name}: needs {window.width()}x{window.height()} instead of {width}x{height}"
        yield from (f"{name} at {width}x{height}: {fault}" for fault in faults(window))


def main(folder: Path) -> None:
    """Print the scale, then a line for each fault."""
    from app.widgets import theme
    from app.window.desktop import make_application, make_context

    application = make_application()
    theme.apply(application, "dark")
    context = make_context(settings_file=folder / "desktop.ini", log_folder=folder / "log")
    context.workspace.folder = folder / "workspace"
    print(application.primaryScreen().devicePixelRatio())
    for fault in walk(context, SIZES[:1]):
        print(fault)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
