"""The menus of the main window. File and Edit depend on the visible page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction, QActionGroup, QKeySequence, QUndoStack
from PySide6.QtWidgets import QMenu, QWidget

from app.context.calibration_status import put_into_use
from app.services.preferences import THEMES
from app.services.settings import RECENT_KINDS
from app.widgets.actions import make_action
from app.widgets.buttons import Slot
from app.widgets.label import key_text, plain_tip
from app.widgets.naming import named
from app.workspace.sessions import DESCRIPTION, is_session

Kind = TypeVar("Kind", bound=QObject)


def below(root: QObject, kind: type[Kind], name: str = "") -> Iterator[Kind]:
    """Find the objects of a kind below a root, each before its own children.

    Parameters
    ----------
    root : QObject
        Start of the search. It is not among the results.
    kind : type
        Type of the objects.
    name : str, optional
        Object name. Empty: any.

    Yields
    ------
    QObject
        The next object found.
    """
    for child in root.children():
        if isinstance(child, kind) and name in ("", child.objectName()):
            yield child
        yield from below(child, kind, name)


if TYPE_CHECKING:
    from app.shell.main_window import MainWindow


class Menus:
    """Builds the menu bar of a window and keeps its changing parts up to date."""

    def __init__(self, window: MainWindow) -> None:
        self._window = window
        self.themes = self._build_themes()
        self.file = FileMenu(window)
        window.menuBar().addMenu(self.file)
        self.edit = EditMenu(window)
        window.menuBar().addMenu(self.edit)
        self._build_view()
        self._build_help()

    def _build_view(self) -> None:
        window = self._window
        menu, add = window.menuBar().addMenu("&View"), partial(_add, window)
        menu.addActions(list(window.page_actions.values()))
        menu.addSeparator()
        menu.addMenu("&Theme").addActions(list(self.themes.values()))
        add(menu, "view.fullscreen", "&Full screen", window.toggle_full_screen, "F11")

    def _build_help(self) -> None:
        window = self._window
        menu, add = window.menuBar().addMenu("&Help"), partial(_add, window)
        add(menu, "help.documentation", "&Documentation", window.show_guide, "F1")
        boards = menu.addMenu("&Printable checkerboards")
        for square, use in ((3, "lens views"), (2, "top surface")):
            text = f"Squares of {square} mm ({use})"
            show = partial(window.open_board, square)
            add(boards, f"help.board_{square}mm", text, show)
        add(menu, "help.log", "Open the &log folder", window.open_log_folder)
        add(menu, "help.about", "&About", window.show_about)

    def _build_themes(self) -> dict[str, QAction]:
        group = QActionGroup(self._window)
        actions = {}
        for key, label in THEMES.items():
            action = make_action(
                self._window, f"theme.{key}", label, partial(self._window.set_theme, key)
            )
            action.setCheckable(True)
            action.setChecked(key == self._window.context.settings.preferences.theme)
            group.addAction(action)
            actions[key] = action
        return actions


def _add(
    window: QWidget, menu: QMenu, name: str, text: str, slot: Slot, key: str = "", sign: str = ""
) -> None:
    """Add an action of the window to a menu."""
    menu.addAction(make_action(window, name, text, slot, keys=(key,), icon_name=sign))


def active_history(page: QWidget | None) -> QUndoStack | None:
    """Return the history that undo acts on: that of the innermost visible part of a page.

    A page may have several, such as one for its measurements and one for its table of records.
    """
    best: tuple[int, QUndoStack] | None = None
    for stack in below(page, QUndoStack) if page is not None else ():
        owner, depth = stack.parent(), 0
        while owner is not None and not isinstance(owner, QWidget):
            owner = owner.parent()
        if not isinstance(owner, QWidget) or not owner.isVisible():
            continue
        parent: QObject | None = owner
        while parent is not None and parent is not page:
            parent, depth = parent.parent(), depth + 1
        if best is None or depth > best[0]:
            best = depth, stack
    return None if best is None else best[1]


class EditMenu(QMenu):
    """Undo and redo. The shortcuts belong to the pages; here they are only shown.

    Parameters
    ----------
    window : MainWindow
        The window with the pages.
    """

    def __init__(self, window: MainWindow) -> None:
        super().__init__("&Edit", window)
        named(self, "edit", "Edit")
        self._window = window
        self.undo_action = self.addAction("", lambda: self._act(QUndoStack.undo))
        self.redo_action = self.addAction("", lambda: self._act(QUndoStack.redo))
        self.undo_action.setObjectName("edit.undo")
        self.redo_action.setObjectName("edit.redo")
        self.aboutToShow.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show what can be undone and redone now."""
        stack = active_history(self._window.shown_page)
        undo = "" if stack is None or not stack.canUndo() else stack.undoText()
        redo = "" if stack is None or not stack.canRedo() else stack.redoText()
        for action, can, text, empty, key in (
            (self.undo_action, undo, "&Undo {what}", "&Undo", QKeySequence("Ctrl+Z")),
            (self.redo_action, redo, "&Redo {what}", "&Redo", QKeySequence("Ctrl+Shift+Z")),
        ):
            words = text.format(what=_first_small(can).replace("&", "&&")) if can else empty
            action.setText(f"{words}\t{key_text(key)}")
            action.setEnabled(bool(can))

    def _act(self, change: Callable[[QUndoStack], None]) -> None:
        stack = active_history(self._window.shown_page)
        if stack is not None:
            change(stack)


def _first_small(text: str) -> str:
    """Return a title as the end of a sentence: "Remove lens_1" becomes "remove lens_1"."""
    return text if text[:2].isupper() else text[:1].lower() + text[1:]


class FileMenu(QMenu):
    """The menu. What can be exported depends on the visible page.

    Parameters
    ----------
    window : MainWindow
        The window with the pages.
    """

    def __init__(self, window: MainWindow) -> None:
        super().__init__("&File", window)
        named(self, "file", "File")
        self._window, self._context = window, window.context
        self.recent = named(QMenu("&Recent files", self), "file.recent", "Recent files")
        self.recent.setToolTipsVisible(True)
        self.recent.aboutToShow.connect(self._fill_recent)
        self.exports = named(QMenu("&Export", self), "file.export", "Export")
        self.exports.aboutToShow.connect(self._fill_exports)
        add = partial(_add, window, self)
        add("file.new", "&New sensor", lambda: window.begin("sensor"), "Ctrl+N", "add")
        session = "&Open session folder…"
        add("file.session", session, window.choose_session, "Ctrl+O", "folder")
        add("file.open", "Open &files…", window.choose_files, "Ctrl+Alt+O")
        self.addMenu(self.recent)
        self.addSeparator()
        calibrations = "&Import calibrations…"
        add("file.import", calibrations, window.import_calibrations, "Ctrl+I", "import")
        self.addMenu(self.exports)
        add("file.stream", "&Stream the live depth…", window.show_stream)
        self.addSeparator()
        add("file.preferences", "&Preferences…", window.show_preferences, "Ctrl+,")
        self.addSeparator()
        add("file.quit", "&Quit", window.close, "Ctrl+Q")
        self._context.source.changed.connect(self._note_recording)
        self._context.requests.calibrations_changed.connect(self._note_calibration)

    # Recent files

    def _note_recording(self) -> None:
        info = self._context.source.info
        if info is not None and info.kind == "recording" and info.file is not None:
            self._context.settings.add_recent("recordings", info.file)

    def _note_calibration(self) -> None:
        used = self._context.workspace.in_use
        if used is not None:
            self._context.settings.add_recent("calibrations", used)

    def _fill_recent(self) -> None:
        self._note_calibration()
        self.recent.clear()
        titles = {
            "sessions": "Sessions",
            "calibrations": "Calibrations",
            "recordings": "Recordings",
        }
        for kind in RECENT_KINDS:
            paths = self._context.settings.recent(kind)
            if paths:
                self.recent.addSection(titles[kind])
            for path in paths:
                self._add_recent(kind, path)
        if self.recent.isEmpty():
            self.recent.addAction("No recent files").setEnabled(False)
            return
        self.recent.addSeparator()
        forget = self.recent.addAction("Clear this list")
        forget.triggered.connect(self._context.settings.forget_recent)

    def _add_recent(self, kind: str, path: Path) -> None:
        missing = why_missing(kind, path)
        text = f"{path.name}  ({missing or path.parent})"
        # An ampersand in a name does not become a mnemonic.
        action = self.recent.addAction(text.replace("&", "&&"))
        action.setToolTip(plain_tip(f"{path}: {missing}" if missing else str(path)))
        action.setEnabled(not missing)
        action.triggered.connect(lambda _=False: self._open(kind, path))

    def _open(self, kind: str, path: Path) -> None:
        if kind == "sessions":
            self._window.open_session(path)
            return
        if kind == "recordings":
            self._window.open_dropped((path,))
        else:
            put_into_use(path, self._window, context=self._context)
        self._window.show_page("inspect")

    # Export

    def _fill_exports(self) -> None:
        self.exports.clear()
        page = self._window.shown_page
        offered: tuple[QAction, ...] = getattr(page, "export_actions", tuple)()
        self.exports.addActions(list(offered))
        if not offered:
            text = "Nothing on this page: export from Sensors, Inspect or Measure"
            self.exports.addAction(text).setEnabled(False)


def why_missing(kind: str, path: Path) -> str:
    """Return why a recent file cannot be opened. Empty if it can."""
    if not path.exists():
        return "not found"
    if kind == "sessions" and not is_session(path):
        return f"contains no {DESCRIPTION}"
    return ""
