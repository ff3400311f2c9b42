"""The main window: state on top, navigation on the left, pages."""

from __future__ import annotations

import linecache
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSize, Qt, QUrl
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QCloseEvent,
    QDesktopServices,
    QDragEnterEvent,
    QDropEvent,
    QGuiApplication,
    QMoveEvent,
)
from PySide6.QtWidgets import (
    QApplication,
    QMainWindow,
    QMenu,
    QSizePolicy,
    QStackedWidget,
    QStyle,
    QToolBar,
    QWidget,
)

from app.program.calibration_entries import ENDING
from app.program.calibration_status import put_into_use, show_in_use
from app.program.context import AppContext
from app.program.file_dialogs import ask_folder, ask_several, dropped_paths, sort_dropped
from app.program.preferences import THEMES
from app.program.session_entries import DESCRIPTION, is_session
from app.widgets import theme
from app.widgets.actions import Slot, make_action
from app.widgets.dialog import ask
from app.widgets.layout import vbox
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.output.recording.recording_format import ENDING as RECORDING_ENDING

from .documentation import OF_PAGE, find_page
from .loader import LoadingView, ModuleLoader
from .malloc_cache import trim_malloc_cache
from .menus import EditMenu, ExportMenu, RecentMenu
from .pages import PAGES, PageEntry
from .state_bar import FailedCalibrationBar, StateBar
from .window_dialogs import AboutDialog, PreferencesDialog

BOARDS = Path(__file__).resolve().parents[2] / "resources" / "checkerboards"
# Modules that open the sources.
SOURCES = ("app.sources.source_list", "app.sources.virtual_bench")
CAMERAS = "app.sources.camera_drivers.opencv"
# What begins on a page: the name of the page, and the method to call.
BEGINNINGS = {
    "sensor": ("calibrate", "begin"),
    "demo": ("inspect", "begin_demo"),
    "press": ("inspect", "begin_press"),
    "measure": ("measure", "begin_demo"),
    "practice": ("calibrate", "begin_demo"),
    "import": ("sensors", "choose_calibrations"),
    "stream": ("inspect", "show_stream"),
}
FIRST_SIZE = QSize(1280, 800)
# Every control of every page can be reached from this size on.
SMALLEST = QSize(1024, 700)
# Raised when toolbars change, so that an old saved layout is not applied to a newer window.
LAYOUT_VERSION = 2
# Delay from a page change to the release of unused memory, and the interval from then on.
TIDY_MS, TIDY_AGAIN_MS = 3_000, 60_000


class MainWindow(QMainWindow):
    """The main window.

    Parameters
    ----------
    context : AppContext
        Passed to all pages.
    pages : tuple of PageEntry, optional
        The pages. Default: those of the program.
    """

    def __init__(self, *, context: AppContext, pages: tuple[PageEntry, ...] | None = None) -> None:
        super().__init__()
        set_names(self, "main", "GelPoLight Studio")
        self.setWindowTitle("GelPoLight Studio")
        # Until the window system has drawn the frame, it is assumed to be that of the style.
        self._fit_screen(QSize(0, self.style().pixelMetric(QStyle.PixelMetric.PM_TitleBarHeight)))
        self.setAcceptDrops(True)
        self.context = context
        self.entries = {entry.name: entry for entry in pages or PAGES}
        self.loader = ModuleLoader(self)
        self._made: dict[str, QWidget] = {}
        self._asked_for, self._ends_work = "", False
        self._stack = set_names(QStackedWidget(self), "main.pages", "Page")
        centre = QWidget()
        vbox(
            FailedCalibrationBar(context.status), (self._stack, 1), of=centre, margins=0, spacing=0
        )
        self.setCentralWidget(centre)
        self._loading = LoadingView()
        self._stack.addWidget(self._loading)
        self.state_bar = StateBar(context=context)
        self.addToolBar(Qt.ToolBarArea.TopToolBarArea, self.state_bar)
        self.page_actions = self._build_navigation()
        self.theme_actions = self._build_theme_actions()
        self.edit_menu = EditMenu(self, self._stack.currentWidget)
        self.recent_menu = RecentMenu(self, self._open_recent, context=context)
        self.export_menu = ExportMenu(self, self._stack.currentWidget)
        self._build_menus()
        context.toasts.attach(self, self.open_log_folder, over=self._stack)
        requests = context.requests
        requests.page.connect(self.show_page)
        requests.session.connect(self.open_session)
        requests.guide.connect(self.show_guide)
        requests.begin.connect(self.begin)
        requests.calibrations_changed.connect(self._show_in_use)
        context.source.changed.connect(self._remember_source)
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._follow_desktop)
        self._tidy = timer(self, 0, self._give_back, once=True)
        self._show_in_use()
        self._restore_layout()

    def _build_navigation(self) -> dict[str, QAction]:
        bar = set_names(QToolBar("Navigation", self, movable=False), "navigation", "Navigation")
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        bar.setIconSize(QSize(24, 24))
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
        group = QActionGroup(self)
        actions = {}
        steps = [name for name in self.entries if name != "start"]
        for name, entry in self.entries.items():
            key = f"Ctrl+{steps.index(name) + 1}" if name in steps else "Ctrl+Home"
            show = partial(self.show_page, name)
            action = make_action(
                self, f"navigation.{name}", entry.title, show, keys=(key,), icon_name=entry.icon
            )
            action.setCheckable(True)
            group.addAction(action)
            bar.addAction(action)
            button = bar.widgetForAction(action)
            set_names(button, f"navigation.button.{name}", entry.title)
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            actions[name] = action
        self.addToolBar(Qt.ToolBarArea.LeftToolBarArea, bar)
        return actions

    def _build_theme_actions(self) -> dict[str, QAction]:
        group = QActionGroup(self)
        actions = {}
        for key, label in THEMES.items():
            show = partial(self.set_theme, key)
            actions[key] = make_action(self, f"theme.{key}", label, show, checkable=True)
            actions[key].setChecked(key == self.context.settings.preferences.theme)
            group.addAction(actions[key])
        return actions

    def _build_menus(self) -> None:
        def add(
            menu: QMenu, name: str, text: str, slot: Slot, key: str = "", sign: str = ""
        ) -> None:
            menu.addAction(make_action(self, name, text, slot, keys=(key,), icon_name=sign))

        bar = self.menuBar()
        file = set_names(bar.addMenu("&File"), "file", "File")
        add(file, "file.new", "&New sensor", partial(self.begin, "sensor"), "Ctrl+N", "add")
        session = "&Open session folder…"
        add(file, "file.session", session, self.choose_session, "Ctrl+O", "folder")
        add(file, "file.open", "Open &files…", self.choose_files, "Ctrl+Alt+O")
        file.addMenu(self.recent_menu)
        file.addSeparator()
        import_files = partial(self.begin, "import")
        add(file, "file.import", "&Import calibrations…", import_files, "Ctrl+I", "import")
        file.addMenu(self.export_menu)
        add(file, "file.stream", "&Stream the live depth…", partial(self.begin, "stream"))
        file.addSeparator()
        add(file, "file.preferences", "&Preferences…", self.show_preferences, "Ctrl+,")
        file.addSeparator()
        add(file, "file.quit", "&Quit", self.close, "Ctrl+Q")
        bar.addMenu(self.edit_menu)
        view = bar.addMenu("&View")
        view.addActions(list(self.page_actions.values()))
        view.addSeparator()
        view.addMenu("&Theme").addActions(list(self.theme_actions.values()))
        add(view, "view.fullscreen", "&Full screen", self.toggle_full_screen, "F11")
        help_menu = bar.addMenu("&Help")
        add(help_menu, "help.documentation", "&Documentation", self.show_guide, "F1")
        boards = help_menu.addMenu("&Printable checkerboards")
        for square_mm, use in ((3, "lens views"), (2, "top surface")):
            text = f"Squares of {square_mm} mm ({use})"
            add(boards, f"help.board_{square_mm}mm", text, partial(self.open_board, square_mm))
        add(help_menu, "help.log", "Open the &log folder", self.open_log_folder)
        add(help_menu, "help.about", "&About", self.show_about)

    def _restore_layout(self) -> None:
        geometry, state = self.context.settings.window_state()
        if not self.restoreGeometry(geometry):
            room = QGuiApplication.primaryScreen().availableSize()
            self.resize(FIRST_SIZE.boundedTo(room * 0.9))
            if self.size() != FIRST_SIZE:
                # The frame would extend beyond the edge of the screen and hide its last line.
                self.setWindowState(Qt.WindowState.WindowMaximized)
        self.restoreState(state, LAYOUT_VERSION)

    # Pages

    @property
    def page_name(self) -> str:
        """Name of the visible page. Empty before the first one."""
        visible = self._stack.currentWidget()
        return next((name for name, page in self._made.items() if page is visible), "")

    def page(self, name: str) -> QWidget:
        """Return a page, and create it at the first request."""
        if name not in self._made:
            page = self.entries[name].make(self.context)
            self._made[name] = page
            self._stack.addWidget(page)
        return self._made[name]

    def show_page(self, name: str) -> None:
        """Show a page. An unknown name shows the first page.

        If the page's modules are still loading, it appears when they are loaded.
        """
        self._with_page(name if name in self.entries else next(iter(self.entries)), lambda _: None)

    def _with_page(self, name: str, act: Callable[[QWidget], object]) -> None:
        """Show a page and run a function on it, unless another page is requested meanwhile."""
        self._asked_for = name
        self.page_actions[name].setChecked(True)

        def go_on() -> None:
            if self._asked_for == name:
                page = self.page(name)
                self._switch_to(page)
                act(page)

        if name not in self._made:
            self._loading.show_message(self.entries[name].title)
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
        self._show_in_use()  # other programs may have changed the workspace
        _call(after, "enter")
        # Changing pages often does not postpone it.
        if not 0 <= self._tidy.remainingTime() <= TIDY_MS:
            self._tidy.start(TIDY_MS)

    def _show_in_use(self) -> None:
        show_in_use(self.context)

    def _give_back(self) -> None:
        linecache.clearcache()  # PySide6 reads the source of every imported module: 50 MB
        trim_malloc_cache()
        self._tidy.start(TIDY_AGAIN_MS)

    def open_path_in(self, name: str, path: Path) -> None:
        """Show a page and open a folder or file in it."""

        def open_path(page: QWidget) -> None:
            with self.context.toasts.errors():
                _call(page, "open_path", path)

        self._with_page(name, open_path)

    def begin(self, what: str) -> None:
        """Begin a task of the user: a key of `BEGINNINGS`, or "source", "session" or "files"."""
        if what in BEGINNINGS:
            name, method = BEGINNINGS[what]
            self._with_page(name, lambda page: _call(page, method))
        else:
            _call(self, f"choose_{what}")

    def choose_source(self) -> None:
        """Let the user choose another source, whose images are shown at once."""
        self._with_page("inspect", lambda _page: self.state_bar.camera.open_menu())

    def choose_source_again(self) -> None:
        """Select the source of the last run as soon as its modules are loaded."""
        kind, place = self.context.settings.source
        if kind:
            again = partial(self.context.source.choose_again, kind, place, self.context.cameras)
            needed = (*SOURCES, CAMERAS) if kind == "camera" else SOURCES
            self.loader.when_loaded(needed, again)

    def _remember_source(self) -> None:
        self.context.settings.source = self.context.source.remembered

    # Sessions and files

    def choose_session(self) -> None:
        """Let the user choose a session folder, and open it."""
        title = "Open a session folder"
        if folder := ask_folder(self, self.context.settings, "session", title):
            self.open_session(folder)

    def choose_files(self) -> None:
        """Let the user choose calibrations, recordings or the description of a session."""
        patterns = f"*{ENDING} *{RECORDING_ENDING} {DESCRIPTION}"
        kinds = f"Calibrations, recordings and sessions ({patterns})"
        if paths := ask_several(self, self.context.settings, "session", "Open", kinds):
            self.open_dropped(paths)

    def open_session(self, folder: Path | str) -> None:
        """Calibrate from a session folder and remember it."""
        folder = Path(folder)
        if not is_session(folder):
            message = "The folder is not a session folder: it contains no session.toml"
            error = InputError(message, folder, Remedy.CHOOSE_SESSION)
            self.context.toasts.show(str(error), "fail")
            return
        self.context.settings.keep_folder("session", folder.parent)
        self.context.settings.add_recent("sessions", folder)
        self.open_path_in("calibrate", folder)

    def _open_recent(self, kind: str, path: Path) -> None:
        if kind == "sessions":
            self.open_session(path)
            return
        if kind == "recordings":
            self.open_dropped((path,))
        else:
            put_into_use(path, self, context=self.context)
        self.show_page("inspect")

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept session folders, calibration files and recordings."""
        if any(sort_dropped(dropped_paths(event.mimeData()))):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the session folder, add the calibrations to the library, play the recording."""
        self.open_dropped(dropped_paths(event.mimeData()))
        event.acceptProposedAction()

    def open_dropped(self, paths: tuple[Path, ...]) -> None:
        """Open the dropped items."""
        sessions, calibrations, recordings = sort_dropped(paths)
        for path in calibrations:
            self.open_path_in("sensors", path)
        for folder in sessions[:1]:
            self.open_session(folder)
        if len(sessions) > 1:
            self.context.toasts.show("Only the first session folder was opened.")
        for file in recordings[:1]:
            self.context.source.choose_recording(file)
            self.context.toasts.show(f"The camera is now {file.name}.")
            if self.page_name == "start":
                self.show_page("inspect")

    # Dialogs

    def show_preferences(self) -> None:
        """Show the preferences."""
        PreferencesDialog(self, self.set_theme, context=self.context).show()

    def show_about(self) -> None:
        """Show the program's version and parts."""
        AboutDialog(self).show()

    def show_guide(self, page: str = "", heading: str = "") -> None:
        """Open the guide in the browser: about the visible page, or at another page and heading."""
        with self.context.toasts.errors():
            file = find_page(page or OF_PAGE.get(self.page_name, "index"))
            self._open_outside(file, "No web browser was found. Read this page", heading)

    def open_board(self, square_mm: int) -> None:
        """Show a printable checkerboard in the PDF viewer of the desktop."""
        path = BOARDS / f"checkerboard-9x6-{square_mm}mm.pdf"
        self._open_outside(path, "No PDF viewer was found. Print this file")

    def open_log_folder(self) -> None:
        """Show the log files in the file manager of the desktop."""
        folder = self.context.log.folder
        self._open_outside(folder, "No file manager was found. The log is in this folder")

    def _open_outside(self, path: Path, otherwise: str, heading: str = "") -> None:
        """Open a file or folder with the desktop's program for it, or show its path."""
        url = QUrl.fromLocalFile(str(path))
        if heading:
            url.setFragment(heading)
        if not QDesktopServices.openUrl(url):
            self.context.toasts.show(f"{otherwise}: {path}", "warn")

    def set_theme(self, choice: str) -> None:
        """Apply a theme and remember it."""
        self.context.settings.prefer(theme=choice)
        self.theme_actions[choice].setChecked(True)
        application = QApplication.instance()
        assert isinstance(application, QApplication)
        theme.apply(application, choice)

    def _follow_desktop(self) -> None:
        if self.context.settings.preferences.theme == "system":
            self.set_theme("system")

    def toggle_full_screen(self) -> None:
        """Switch full screen on or off."""
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def _close_anyway(self) -> None:
        self._ends_work = True
        self.close()

    def _fit_screen(self, frame: QSize) -> None:
        """Let the window shrink until it fits the screen with its frame."""
        self.setMinimumSize(SMALLEST.boundedTo(self.screen().availableSize() - frame))

    def moveEvent(self, event: QMoveEvent) -> None:
        """Follow the frame, which comes with the first move, and the screen."""
        super().moveEvent(event)
        self._fit_screen(self.frameSize() - self.size())

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask all pages, then leave the visible one and save the window layout."""
        # All are asked before the first one ends its work.
        work = " ".join(_call(page, "unfinished", default="") for page in self._made.values())
        if work.strip() and not self._ends_work:
            event.ignore()
            close = "Close anyway", self._close_anyway
            ask(self, "Close the program?", work.strip(), close).prefer_cancel()
            return
        if not all(_call(page, "can_close", default=True) for page in self._made.values()):
            event.ignore()
            return
        _call(self._stack.currentWidget(), "leave")
        settings = self.context.settings
        settings.keep_window_state(self.saveGeometry(), self.saveState(LAYOUT_VERSION))
        settings.save()
        self.loader.stop()
        self._tidy.stop()
        self.context.toasts.clear()
        for page in self._made.values():
            page.close()
        super().closeEvent(event)


def _call(page: QWidget | None, method: str, *arguments: Any, default: Any = None) -> Any:
    """Call a method if the page has it."""
    function = getattr(page, method, None)
    return default if function is None else function(*arguments)
