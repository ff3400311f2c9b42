"""Actions on the calibrations of the library, their messages and their history."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from PySide6.QtGui import QUndoStack
from PySide6.QtWidgets import QWidget

from app.context.calibration_status import put_into_use
from app.context.context import AppContext
from app.widgets.dialog import Kinds
from app.widgets.question import ask
from app.widgets.undo import Change, UndoStep
from app.workspace.entries import Entry
from app.workspace.sessions import SessionEntry
from app.workspace.trash import Removal


class CalibrationActions:
    """Changes the workspace. Every InputError becomes a message.

    Attributes
    ----------
    undo : QUndoStack
        History of removals, restorations and choices of the calibration in use.
    """

    def __init__(self, page: QWidget, *, context: AppContext) -> None:
        self._page, self._context = page, context
        self.undo = QUndoStack(page)
        self._folder = context.workspace.folder
        context.requests.calibrations_changed.connect(self._on_changed)

    def entries(self) -> tuple[Entry, ...]:
        """Return all calibrations. If the workspace cannot be read: none, with a message."""
        with self._context.toasts.errors():
            return self._context.workspace.entries()
        return ()

    def sessions(self) -> tuple[SessionEntry, ...]:
        """Return all sessions. If the workspace cannot be read: none, with a message."""
        with self._context.toasts.errors():
            return self._context.workspace.sessions()
        return ()

    def import_files(self, files: Iterable[Path]) -> Path | None:
        """Copy calibration files into the library. Return the path of the last one."""
        imported = None
        for file in files:
            with self._context.toasts.errors():
                imported = self._context.workspace.import_calibration(file)
                text = f"{imported.name} is now in the library of sensor {imported.parent.name}."
                self._context.toasts.show(text)
        if imported is not None:
            self._context.requests.calibrations_changed.emit()
        return imported

    def use(self, entry: Entry) -> None:
        """Use this calibration from now on."""
        workspace, before = self._context.workspace, self._context.workspace.in_use
        use = partial(
            self._push,
            f"use of {entry.path.stem}",
            lambda: workspace.use(entry.path),
            lambda: workspace.use(before),
        )
        put_into_use(entry.path, self._page, context=self._context, use=use)

    def remove(self, entry: Entry) -> None:
        """Move a calibration to the trash. Ask first if it is in use or validated."""
        reasons = {
            (True, True): "{name} is validated, and it is the calibration in use.",
            (True, False): "{name} is the calibration in use.",
            (False, True): "{name} is validated.",
        }
        reason = reasons.get((entry.in_use, entry.validated))
        if reason is None:
            self._remove(entry)
            return
        text = "{reason} Move it to the trash? You can restore it from there."
        question = ask(
            self._page,
            "Remove calibration",
            text.format(reason=reason.format(name=entry.path.name)),
            ("Move to trash", lambda: self._remove(entry)),
        )
        cancel = question.buttons.button(Kinds.Cancel)
        cancel.setDefault(True)
        cancel.setFocus()

    def removals(self) -> tuple[Removal, ...]:
        """Return the calibrations in the trash. If it cannot be read: none, with a message."""
        with self._context.toasts.errors():
            return self._context.workspace.removals()
        return ()

    def restore(self, removal: Removal) -> None:
        """Move a calibration from the trash back to its place. The one in use stays in use."""
        removals = [removal]
        workspace = self._context.workspace
        if self._push(
            f"restoration of {removal.old_path.stem}",
            lambda: workspace.restore(removals[-1], use=workspace.in_use is None),
            lambda: removals.append(workspace.remove(removal.old_path)),
        ):
            text = f"{removal.old_path.name} is in the library again."
            self._context.toasts.show(text)

    def _remove(self, entry: Entry) -> None:
        workspace, removals = self._context.workspace, list[Removal]()
        if self._push(
            f"removal of {entry.path.stem}",
            lambda: removals.append(workspace.remove(entry.path)),
            lambda: workspace.restore(removals[-1]),
        ):
            self._context.toasts.show(
                f"{entry.path.name} was moved to the trash.",
                actions=(("Undo", self.undo.undo),),
            )

    def _push(self, text: str, redo: Change, undo: Change) -> bool:
        step = UndoStep(text, partial(self._try, redo), partial(self._try, undo))
        self.undo.push(step)
        return step.worked

    def _try(self, change: Change) -> bool:
        worked = False
        with self._context.toasts.errors():
            change()
            worked = True
        self._context.requests.calibrations_changed.emit()
        return worked

    def _on_changed(self) -> None:
        """Forget what was done in another workspace."""
        if self._context.workspace.folder != self._folder:
            self._folder = self._context.workspace.folder
            self.undo.clear()
