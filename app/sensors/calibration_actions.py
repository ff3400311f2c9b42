"""Actions on the calibrations of the library, and their messages."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from PySide6.QtCore import QFile
from PySide6.QtWidgets import QWidget

from app.context.calibration_status import put_into_use
from app.context.context import AppContext
from app.widgets.dialog import Kinds
from app.widgets.question import ask
from app.workspace.entries import Entry
from app.workspace.sessions import SessionEntry


class CalibrationActions:
    """Changes the workspace. Every InputError becomes a message."""

    def __init__(self, page: QWidget, *, context: AppContext) -> None:
        self._page, self._context = page, context

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
        put_into_use(entry.path, self._page, context=self._context)

    def remove(self, entry: Entry) -> None:
        """Ask once, then move a calibration to the trash of the system."""
        text = f"Move {entry.path.name} to the trash of the system?"
        if entry.in_use:
            text += " It is the calibration in use."
        if entry.validated:
            text += " It is validated."
        question = ask(
            self._page,
            "Remove calibration",
            text,
            ("Move to trash", lambda: self._remove(entry)),
        )
        cancel = question.buttons.button(Kinds.Cancel)
        cancel.setDefault(True)
        cancel.setFocus()

    def _remove(self, entry: Entry) -> None:
        toasts = self._context.toasts
        with toasts.errors():
            self._context.workspace.remove(entry.path, _discard)
            toasts.show(f"{entry.path.name} is in the trash of the system.")
        self._context.requests.calibrations_changed.emit()


def _discard(file: Path) -> bool:
    return bool(QFile.moveToTrash(str(file)))
