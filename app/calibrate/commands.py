"""Undo commands: captures and corrections of a session."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QUndoCommand

from gelpolight_core.errors import InputError


class Correction(QUndoCommand):
    """One correction and its reverse; each changes only the data that it is about.

    A command that cannot be written to disk has no effect and leaves the history.

    Parameters
    ----------
    text : str
        Text in the history list.
    act, revert : callable
        Written to disk before they return; raise InputError on failure.
    done : callable
        Called after either of them.
    refused : callable
        Called with the reason when the command failed.
    is_done : bool, optional
        Whether the change is already done when the command enters the history, as for a capture.
    """

    def __init__(
        self,
        text: str,
        act: Callable[[], None],
        revert: Callable[[], None],
        *,
        done: Callable[[], None],
        refused: Callable[[str], object],
        is_done: bool = False,
    ) -> None:
        super().__init__(text)
        self._is_done = is_done
        self._act, self._revert = act, revert
        self._done, self._refused = done, refused

    def redo(self) -> None:
        """Apply the correction."""
        if self._is_done:
            self._is_done = False
            return
        self._run(self._act)

    def undo(self) -> None:
        """Undo the correction."""
        self._run(self._revert)

    def _run(self, change: Callable[[], None]) -> None:
        try:
            change()
        except InputError as error:
            self.setObsolete(True)
            self._refused(str(error))
        self._done()
