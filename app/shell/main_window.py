"""The one window: navigation at the left, pages, status bar."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSize, Qt, QTimer, QUrl
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QCloseEvent,
    QDesktopServices,
    QDragEnterEvent,
    QDropEvent,
    QGuiApplication,
)
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QFileDialog,
    QMainWindow,
    QSizePolicy,
    QStackedWidget,
    QToolBar,
    QWidget,
)

from app.shell import theme
from app.shell.about import AboutDialog
from app.shell.context import AppContext
from app.shell.documentation import find_documentation
from app.shell.dropping import dropped_paths, is_session, sort_dropped
from app.shell.icons import icon
from app.shell.loader import Loader
from app.shell.loading_view import LoadingView
from app.shell.log_window import LogWindow
from app.shell.memory import give_back
from app.shell.menus import Menus
from app.shell.pages import PageEntry, all_pages
from app.shell.preferences import PreferencesDialog
from app.shell.shortcuts import ShortcutSheet
from app.shell.status import StatusLine
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

BOARDS = Path(__file__).resolve().parents[2] / "resources" / "checkerboards"
# What the sources are made with.
SOURCES = ("app.sources.listing", "app.sources.bench")
FIRST_SIZE = QSize(1280, 800)
# Raised when toolbars change, so that an older layout is not forced onto a newer window.
LAYOUT_VERSION = 1
# How long after another page was shown memory is given back, and how often from then on.
TIDY_MS, TIDY_AGAIN_MS = 3_000, 60_000


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
        self.setAcceptDrops(True)
        self.context = context
        self.entries = {entry.name: entry for entry in pages or all_pages()}
        self.loader = Loader(self)
        self._made: dict[str, QWidget] = {}
        self._asked_for = ""
        self._log_window: LogWindow | None = None
        self._precision: QDialog | None = None
        self._stack = named(QStackedWidget(self), "main.pages", tr("Page"))
        self.setCentralWidget(self._stack)
        self._loading = LoadingView()
        self._stack.addWidget(self._loading)
        self.page_actions = self._build_navigation()
        self.menus = Menus(self)
        self.setStatusBar(StatusLine(context.status))
        context.toasts.attach(self._stack, self.show_log)
        requests = context.requests
        requests.page.connect(self.show_page)
        requests.path.connect(self.open_path_in)
        requests.session.connect(self.open_session)
        requests.choose_session.connect(self.choose_session)
        requests.new_sensor.connect(self.begin_new_sensor)
        requests.demo.connect(context.source.choose_virtual_sensor)
        requests.begin_demo.connect(self.begin_demo)
        context.source.changed.connect(self._remember_source)
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._follow_desktop)
        self._tidy = QTimer(self)
        self._tidy.setSingleShot(True)
        self._tidy.timeout.connect(self._give_back)
        self._restore_layout()

    def _build_navigation(self) -> dict[str, QAction]:
        bar = named(QToolBar(tr("Navigation"), self), "navigation", tr("Navigation"))
        bar.setMovable(False)
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        bar.setIconSize(QSize(28, 28))
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
        group = QActionGroup(self)
        actions = {}
        for number, entry in enumerate(self.entries.values(), start=1):
            action = QAction(icon(entry.icon), entry.title, self)
            action.setObjectName(f"navigation.{entry.name}")
            action.setCheckable(True)
            action.setShortcut(f"Ctrl+{number}")
            action.setToolTip(plain_tip(f"{entry.title} (Ctrl+{number})"))
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

    def _restore_layout(self) -> None:
        geometry, state = self.context.settings.window_state()
        if not self.restoreGeometry(geometry):
            room = self.screen().availableSize()
            self.resize(FIRST_SIZE.boundedTo(room * 0.9))
            if self.size() != FIRST_SIZE:
                # Its frame would reach over the screen's edge, and the status bar with it.
                self.setWindowState(Qt.WindowState.WindowMaximized)
        self.restoreState(state, LAYOUT_VERSION)

    # Pages

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
        """Show a page; a name that is not registered is the first page's.

        One whose modules are not loaded yet is shown as soon as they are.
        """
        self._with_page(name if name in self.entries else next(iter(self.entries)), lambda _: None)

    def _with_page(self, name: str, act: Callable[[QWidget], object]) -> None:
        """Show a page and do something with it, unless another is asked for meanwhile."""
        self._asked_for = name
        self.page_actions[name].setChecked(True)

        def go_on() -> None:
            if self._asked_for == name:
                page = self.page(name)
                self._switch_to(page)
                self.context.settings.last_page = name
                act(page)

        if name not in self._made:
            self._loading.say(self.entries[name].title)
            self.loader.when_loaded(self.entries[name].modules, go_on)
            if name not in self._made:
                self._switch_to(self._loading)
            return
        go_on()

    def _switch_to(self, after: QWidget) -> None:
        before = self._stack.currentWidget()
        if after is before:
            return
        _call(before, "leave")
        self._stack.setCurrentWidget(after)
        _call(after, "enter")
        # Not put off by those who go from page to page.
        if not 0 <= self._tidy.remainingTime() <= TIDY_MS:
            self._tidy.start(TIDY_MS)

    def _give_back(self) -> None:
        give_back()
        self._tidy.start(TIDY_AGAIN_MS)

    def open_path_in(self, name: str, path: str) -> None:
        """Show a page and let it open a folder or file."""
        if name in self.entries:
            self._with_page(name, lambda page: self._open_path(page, Path(path)))

    def _open_path(self, page: QWidget, path: Path) -> None:
        try:
            _call(page, "open_path", path)
        except InputError as error:
            self.context.toasts.show(str(error), "fail")

    def begin_new_sensor(self) -> None:
        """Begin to calibrate a sensor, where that is there."""
        if "calibrate" in self.entries:
            self._with_page("calibrate", lambda page: _call(page, "begin"))

    def begin_demo(self) -> None:
        """Put the virtual sensor in as the source, and begin to calibrate it where that is there.

        A page that knows how to begin on it (``begin_demo``) is asked to.
        """
        if "calibrate" not in self.entries:
            self.context.source.choose_virtual_sensor()
            return

        def begin(page: QWidget) -> None:
            self.context.source.choose_virtual_sensor()
            _call(page, "begin_demo")

        self._with_page("calibrate", begin)

    def choose_source_again(self) -> None:
        """Choose the source of last time, once what it needs is loaded."""
        kind, file = self.context.settings.source
        if kind:
            again = partial(self.context.source.choose_again, kind, file)
            self.loader.when_loaded(SOURCES, again)

    def _remember_source(self) -> None:
        self.context.settings.source = self.context.source.remembered

    # Sessions and files

    def choose_session(self) -> None:
        """Let the person choose a session folder, and open it."""
        settings = self.context.settings
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Open a session folder"), str(settings.last_folder)
        )
        if chosen:
            self.open_session(Path(chosen))

    def open_session(self, folder: Path | str) -> None:
        """Calibrate from a session folder, and remember it."""
        folder = Path(folder)
        if not is_session(folder):
            error = InputError(
                tr("this is no session folder: it holds no session.toml"),
                where=str(folder),
                advice=tr("Choose the folder that holds session.toml and the stages' pictures"),
            )
            self.context.toasts.show(str(error), "fail")
            return
        self.context.settings.last_folder = folder.parent
        self.context.settings.add_recent_session(folder)
        self.open_path_in("calibrate", str(folder))

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take session folders, calibration files and recordings."""
        if sort_dropped(dropped_paths(event.mimeData())):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the session folder, add the calibrations to the library, play the recording."""
        self.open_dropped(dropped_paths(event.mimeData()))
        event.acceptProposedAction()

    def open_dropped(self, paths: tuple[Path, ...]) -> None:
        """Open what was dropped."""
        dropped = sort_dropped(paths)
        for path in dropped.calibrations:
            self.open_path_in("sensors", str(path))
        for folder in dropped.sessions[:1]:
            self.open_session(folder)
        if len(dropped.sessions) > 1:
            self.context.toasts.show(tr("Only the first session folder was opened."))
        for file in dropped.recordings[:1]:
            self.context.source.choose_recording(file)
            self.context.toasts.show(tr("The camera is now {name}.").format(name=file.name))

    # Dialogs

    def show_log(self) -> None:
        """Show the log."""
        if self._log_window is None:
            self._log_window = LogWindow(self.context.log, self)
        self._log_window.show()
        self._log_window.raise_()

    def show_preferences(self) -> None:
        """Show the preferences."""
        dialog = PreferencesDialog(self.context.settings, self)
        dialog.theme_changed.connect(self.set_theme)
        dialog.workspace_changed.connect(self._set_workspace)
        dialog.limits_changed.connect(self.context.requests.calibrations_changed)
        _show(dialog)

    def show_shortcuts(self) -> None:
        """Show all shortcuts."""
        _show(ShortcutSheet(self))

    def show_about(self) -> None:
        """Show what this program is made of."""
        _show(AboutDialog(self))

    def show_precision(self) -> None:
        """Show what accuracy costs on this machine."""
        from app.inspect.precision_dialog import PrecisionDialog  # heavy: it knows every method

        if self._precision is None:
            self._precision = PrecisionDialog(context=self.context, parent=self)
        self._precision.show()
        self._precision.raise_()

    def show_guide(self) -> None:
        """Show the documentation, in what the desktop shows web pages with."""
        page = find_documentation()
        if page is None:
            text = tr("This installation came without the documentation: see docs in the sources.")
            self.context.toasts.show(text, "warn")
        elif not QDesktopServices.openUrl(QUrl.fromLocalFile(str(page))):
            text = tr("Nothing here shows web pages; the documentation is at {path}")
            self.context.toasts.show(text.format(path=page), "warn")

    def open_board(self, square_mm: int) -> None:
        """Show a checkerboard to print, in what the desktop shows PDF with."""
        path = BOARDS / f"checkerboard-9x6-{square_mm}mm.pdf"
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(path))):
            self.context.toasts.show(
                tr("Nothing here shows PDF; print this file: {path}").format(path=path), "warn"
            )

    def set_theme(self, choice: str) -> None:
        """Show a theme and remember it."""
        self.context.settings.theme = choice
        self.menus.themes[choice].setChecked(True)
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        theme.apply(application, choice)

    def _follow_desktop(self) -> None:
        if self.context.settings.theme == "system":
            self.set_theme("system")

    def _set_workspace(self, folder: str) -> None:
        self.context.workspace.folder = Path(folder)
        self.context.requests.calibrations_changed.emit()

    def toggle_full_screen(self) -> None:
        """Fill the screen, or go back."""
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask the pages, then leave the one that is shown and remember the window."""
        if not all(_call(page, "may_close", default=True) for page in self._made.values()):
            event.ignore()
            return
        shown = self._stack.currentWidget()
        if shown is not None:
            _call(shown, "leave")
        settings = self.context.settings
        settings.keep_window_state(self.saveGeometry(), self.saveState(LAYOUT_VERSION))
        settings.save()
        self.loader.stop()
        self._tidy.stop()
        self.context.toasts.clear()
        for page in self._made.values():
            page.close()
        if self._log_window is not None:
            self._log_window.close()
        if self._precision is not None:
            self._precision.close()
        super().closeEvent(event)


def _show(dialog: QDialog) -> None:
    """Show a dialog beside the work, not in its way."""
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.show()


def _call(page: QWidget, method: str, *arguments: Any, default: Any = None) -> Any:
    """Call a method that a page may have."""
    function = getattr(page, method, None)
    return default if function is None else function(*arguments)
