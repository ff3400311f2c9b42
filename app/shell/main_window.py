"""The one window: navigation at the left, pages, status bar."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QActionGroup, QCloseEvent
from PySide6.QtWidgets import QMainWindow, QSizePolicy, QStackedWidget, QToolBar, QWidget

from app.shell.context import AppContext
from app.shell.icons import icon
from app.shell.pages import PageEntry, all_pages
from app.shell.status import StatusLine
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class MainWindow(QMainWindow):
    """The main window.

    Parameters
    ----------
    context : AppContext
        What all pages are given.
    pages : tuple of PageEntry, optional
        The pages; those of the program without it.
    """

    def __init__(self, *, context: AppContext, pages: tuple[PageEntry, ...] | None = None) -> None:
        super().__init__()
        named(self, "main", tr("GelPoLight Studio"))
        self.setWindowTitle(tr("GelPoLight Studio"))
        self.setMinimumSize(800, 560)
        self.context = context
        self.entries = {entry.name: entry for entry in pages or all_pages()}
        self._made: dict[str, QWidget] = {}
        self._stack = named(QStackedWidget(self), "main.pages", tr("Page"))
        self.setCentralWidget(self._stack)
        self.page_actions = self._build_navigation()
        self.setStatusBar(StatusLine(context.status))
        context.toasts.attach(self._stack, self.show_log)
        context.requests.page.connect(self.show_page)
        context.requests.path.connect(self.open_path_in)

    def _build_navigation(self) -> dict[str, QAction]:
        bar = named(QToolBar(tr("Navigation"), self), "navigation", tr("Navigation"))
        bar.setMovable(False)
        bar.setIconSize(QSize(28, 28))
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
        bar.toggleViewAction().setEnabled(False)
        group = QActionGroup(self)
        actions = {}
        for number, entry in enumerate(self.entries.values(), start=1):
            action = QAction(icon(entry.icon), entry.title, self)
            action.setObjectName(f"navigation.{entry.name}")
            action.setCheckable(True)
            action.setShortcut(f"Ctrl+{number}")
            action.setToolTip(f"{entry.title} (Ctrl+{number})")
            action.triggered.connect(lambda _=False, name=entry.name: self.show_page(name))
            group.addAction(action)
            bar.addAction(action)
            button = bar.widgetForAction(action)
            named(button, f"navigation.button.{entry.name}", entry.title)
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            actions[entry.name] = action
        self.addToolBar(Qt.ToolBarArea.LeftToolBarArea, bar)
        return actions

    @property
    def page_name(self) -> str:
        """Name of the page that is shown; empty before the first."""
        shown = self._stack.currentWidget()
        return next((name for name, page in self._made.items() if page is shown), "")

    def page(self, name: str) -> QWidget:
        """Return a page, made now if it is asked for the first time."""
        if name not in self._made:
            page = self.entries[name].make(self.context)
            self._made[name] = page
            self._stack.addWidget(page)
        return self._made[name]

    def show_page(self, name: str) -> None:
        """Show a page."""
        before = self._stack.currentWidget()
        after = self.page(name)
        self.page_actions[name].setChecked(True)
        if after is before:
            return
        if before is not None:
            _call(before, "leave")
        self._stack.setCurrentWidget(after)
        self.context.settings.last_page = name
        _call(after, "enter")

    def open_path_in(self, name: str, path: str) -> None:
        """Show a page and let it open a folder or file."""
        if name not in self.entries:
            return
        self.show_page(name)
        try:
            _call(self.page(name), "open_path", Path(path))
        except InputError as error:
            self.context.toasts.show(str(error), "fail")

    def show_log(self) -> None:
        """Show the log."""

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask the pages, then leave the one that is shown and remember the window."""
        if not all(_call(page, "may_close", default=True) for page in self._made.values()):
            event.ignore()
            return
        shown = self._stack.currentWidget()
        if shown is not None:
            _call(shown, "leave")
        self.context.settings.keep_window_state(self.saveGeometry(), self.saveState())
        self.context.settings.save()
        self.context.toasts.clear()
        for page in self._made.values():
            page.close()
        super().closeEvent(event)


def _call(page: QWidget, method: str, *arguments: Any, default: Any = None) -> Any:
    """Call a method that a page may have."""
    function = getattr(page, method, None)
    return default if function is None else function(*arguments)
