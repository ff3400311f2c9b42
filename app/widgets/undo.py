"""Steps that can be undone."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QUndoCommand

UndoFunction = Callable[[], object]


class UndoStep(QUndoCommand):
    """A step of two functions. One that returns False failed, and the step leaves the history.

    Parameters
    ----------
    text : str
        Text for the menu.
    redo, undo : callable
        Do it, and undo it.
    """

    def __init__(self, text: str, redo: UndoFunction, undo: UndoFunction) -> None:
        super().__init__(text)
        self._redo, self._undo = redo, undo

    def redo(self) -> None:
        """Do it."""
        self.setObsolete(self._redo() is False)

    def undo(self) -> None:
        """Undo it."""
        self.setObsolete(self._undo() is False)
