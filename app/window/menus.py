"""Menus whose items depend on the visible page or on the files used before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtGui import QAction, QKeySequence, QUndoStack
from PySide6.QtWidgets import QMenu, QWidget

from app.program.context import AppContext
from app.program.session_entries import DESCRIPTION, is_session
from app.program.settings import RECENT_KINDS
from app.widgets.label import key_text, plain_tip
from app.widgets.widget_names import set_names

VisiblePage = Callable[[], QWidget | None]


class EditMenu(QMenu):
    """Undo and redo on the visible page, with the shortcuts of the page.

    Parameters
    ----------
    parent : QWidget
        The window.
    visible_page : callable
        Returns the visible page.
    """

    def __init__(self, parent: QWidget, visible_page: VisiblePage) -> None:
        super().__init__("&Edit", parent)
        set_names(self, "edit", "Edit")
        self._visible_page = visible_page
        self.undo_action = self.addAction("", lambda: self._act(QUndoStack.undo))
        self.redo_action = self.addAction("", lambda: self._act(QUndoStack.redo))
        self.undo_action.setObjectName("edit.undo")
        self.redo_action.setObjectName("edit.redo")
        self.aboutToShow.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show what can be undone and redone now."""
        stack = self._history()
        undo = "" if stack is None or not stack.canUndo() else stack.undoText()
        redo = "" if stack is None or not stack.canRedo() else stack.redoText()
        for action, verb, command, key in (
            (self.undo_action, "&Undo", undo, QKeySequence("Ctrl+Z")),
            (self.redo_action, "&Redo", redo, QKeySequence("Ctrl+Shift+Z")),
        ):
            words = f"{verb} {_first_small(command).replace('&', '&&')}".rstrip()
            action.setText(f"{words}\t{key_text(key)}")
            action.setEnabled(bool(command))

    def _history(self) -> QUndoStack | None:
        """Return the history of the visible part of the page, if it has one."""
        history: QUndoStack | None = getattr(self._visible_page(), "history", None)
        return history

    def _act(self, change: Callable[[QUndoStack], None]) -> None:
        if (stack := self._history()) is not None:
            change(stack)


def _first_small(text: str) -> str:
    """Return a title as the end of a sentence: "Remove lens_1" becomes "remove lens_1"."""
    return text if text[:2].isupper() else text[:1].lower() + text[1:]


class RecentMenu(QMenu):
    """The sessions, calibrations and recordings that were used last.

    Parameters
    ----------
    parent : QWidget
        The window.
    open_file : callable
        Opens a file, given its kind (one of `RECENT_KINDS`) and path.
    context : AppContext
        Holds the settings with the list, and reports what comes into use.
    """

    def __init__(
        self, parent: QWidget, open_file: Callable[[str, Path], None], *, context: AppContext
    ) -> None:
        super().__init__("&Recent files", parent)
        set_names(self, "file.recent", "Recent files")
        self._open_file, self._context = open_file, context
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self._fill)
        context.source.changed.connect(self._note_recording)
        context.requests.calibrations_changed.connect(self._note_calibration)

    def _note_recording(self) -> None:
        info = self._context.source.info
        if info is not None and info.kind == "recording" and info.file is not None:
            self._context.settings.add_recent("recordings", info.file)

    def _note_calibration(self) -> None:
        if used := self._context.workspace.in_use:
            self._context.settings.add_recent("calibrations", used)

    def _fill(self) -> None:
        self._note_calibration()
        self.clear()
        for kind in RECENT_KINDS:
            paths = self._context.settings.recent(kind)
            if paths:
                self.addSection(kind.capitalize())
            for path in paths:
                self._add_file(kind, path)
        if self.isEmpty():
            self.addAction("No recent files").setEnabled(False)
            return
        self.addSeparator()
        forget = self.addAction("Clear this list")
        forget.triggered.connect(self._context.settings.forget_recent)

    def _add_file(self, kind: str, path: Path) -> None:
        missing = why_missing(kind, path)
        text = f"{path.name}  ({missing or path.parent})"
        # An ampersand in a name does not become a mnemonic.
        action = self.addAction(text.replace("&", "&&"))
        action.setToolTip(plain_tip(f"{path}: {missing}" if missing else str(path)))
        action.setEnabled(not missing)
        action.triggered.connect(lambda _=False: self._open_file(kind, path))


class ExportMenu(QMenu):
    """What the visible page can export.

    Parameters
    ----------
    parent : QWidget
        The window.
    visible_page : callable
        Returns the visible page.
    """

    def __init__(self, parent: QWidget, visible_page: VisiblePage) -> None:
        super().__init__("&Export", parent)
        set_names(self, "file.export", "Export")
        self.setToolTipsVisible(True)
        self._visible_page = visible_page
        self.aboutToShow.connect(self._fill)

    def _fill(self) -> None:
        self.clear()
        offered: tuple[QAction, ...] = getattr(self._visible_page(), "export_actions", tuple)()
        self.addActions(list(offered))
        if not offered:
            text = "Nothing on this page: export from Sensors, Inspect or Measure"
            self.addAction(text).setEnabled(False)


def why_missing(kind: str, path: Path) -> str:
    """Return why a recent file cannot be opened. Empty if it can."""
    if not path.exists():
        return "not found"
    if kind == "sessions" and not is_session(path):
        return f"contains no {DESCRIPTION}"
    return ""
