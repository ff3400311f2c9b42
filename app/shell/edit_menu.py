"""The Edit menu: undo and redo of the visible page, with the name of what they do."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject
from PySide6.QtGui import QKeySequence, QUndoStack
from PySide6.QtWidgets import QMenu, QWidget

from app.widgets.label import key_text
from app.widgets.naming import named
from app.widgets.qt_tree import below
from gelpolight_core.translation import tr


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
    window : QWidget
        Main window, with the visible page as `shown_page`.
    """

    def __init__(self, window: QWidget) -> None:
        super().__init__(tr("&Edit"), window)
        named(self, "edit", tr("Edit"))
        self._window = window
        self.undo_action = self.addAction("", lambda: self._act(QUndoStack.undo))
        self.redo_action = self.addAction("", lambda: self._act(QUndoStack.redo))
        self.undo_action.setObjectName("edit.undo")
        self.redo_action.setObjectName("edit.redo")
        self.aboutToShow.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show what can be undone and redone now."""
        stack = active_history(getattr(self._window, "shown_page", None))
        undo = "" if stack is None or not stack.canUndo() else stack.undoText()
        redo = "" if stack is None or not stack.canRedo() else stack.redoText()
        for action, can, text, empty, key in (
            (self.undo_action, undo, tr("&Undo {what}"), tr("&Undo"), QKeySequence("Ctrl+Z")),
            (self.redo_action, redo, tr("&Redo {what}"), tr("&Redo"), QKeySequence("Ctrl+Shift+Z")),
        ):
            words = text.format(what=_first_small(can).replace("&", "&&")) if can else empty
            action.setText(f"{words}\t{key_text(key)}")
            action.setEnabled(bool(can))

    def _act(self, change: Callable[[QUndoStack], None]) -> None:
        stack = active_history(getattr(self._window, "shown_page", None))
        if stack is not None:
            change(stack)


def _first_small(text: str) -> str:
    """Return a title as the end of a sentence: "Remove lens_1" becomes "remove lens_1"."""
    return text if text[:2].isupper() else text[:1].lower() + text[1:]
