"""Undoable changes of the library: use, remove and restore a calibration."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtGui import QUndoCommand

from app.context.context import AppContext
from app.workspace.trash import Removal
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class LibraryCommand(QUndoCommand):
    """A change of the library. One that fails leaves the history, with a message.

    Attributes
    ----------
    worked : bool
        Whether the last change was made.
    """

    def __init__(self, text: str, *, context: AppContext) -> None:
        super().__init__(text)
        self._context, self.worked = context, False

    def _run(self, change: Callable[[], None]) -> None:
        try:
            change()
            self.worked = True
        except InputError as error:
            self.worked = False
            self.setObsolete(True)
            self._context.toasts.show(str(error), "fail")
        self._context.requests.calibrations_changed.emit()


class UseCommand(LibraryCommand):
    """Choice of the calibration in use."""

    def __init__(self, path: Path, *, context: AppContext) -> None:
        super().__init__(tr("use of {name}").format(name=path.stem), context=context)
        self._path, self._before = path, context.workspace.in_use

    def redo(self) -> None:
        """Use it."""
        self._run(lambda: self._context.workspace.use(self._path))

    def undo(self) -> None:
        """Use the one before, or none."""
        self._run(lambda: self._context.workspace.use(self._before))


class RemoveCommand(LibraryCommand):
    """Removal of a calibration."""

    def __init__(self, path: Path, *, context: AppContext) -> None:
        super().__init__(tr("removal of {name}").format(name=path.stem), context=context)
        self._path = path
        self._removal: Removal | None = None

    def redo(self) -> None:
        """Move it to the trash."""

        def remove() -> None:
            self._removal = self._context.workspace.remove(self._path)

        self._run(remove)

    def undo(self) -> None:
        """Restore it, and use it again if it was in use."""
        assert self._removal is not None
        removal = self._removal
        self._run(lambda: self._context.workspace.restore(removal))


class RestoreCommand(LibraryCommand):
    """Restoration of a calibration from the trash. The calibration in use stays in use."""

    def __init__(self, removal: Removal, *, context: AppContext) -> None:
        name = removal.old_path.stem
        super().__init__(tr("restoration of {name}").format(name=name), context=context)
        self._removal = removal

    def redo(self) -> None:
        """Restore it."""
        workspace = self._context.workspace
        self._run(lambda: workspace.restore(self._removal, use=workspace.in_use is None))

    def undo(self) -> None:
        """Move it to the trash again."""

        def remove() -> None:
            self._removal = self._context.workspace.remove(self._removal.old_path)

        self._run(remove)
