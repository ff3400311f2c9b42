"""What can be undone: a person's captures and corrections in a session."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QUndoCommand

from gelpolight_core.errors import InputError


class Correction(QUndoCommand):
    """One correction and how to take it back; neither touches what it is not about.

    One that cannot be written to disk does not stand, and leaves the history.

    Parameters
    ----------
    text : str
        What the history list says.
    act, take_back : callable
        On disk before they return, or an InputError.
    done : callable
        Called after either.
    refused : callable
        Told why it could not be done.
    is_done : bool, optional
        Whether it stands already as it comes into the history, as a capture does.
    """

    def __init__(
        self,
        text: str,
        act: Callable[[], None],
        take_back: Callable[[], None],
        *,
        done: Callable[[], None],
        refused: Callable[[str], object],
        is_done: bool = False,
    ) -> None:
        super().__init__(text)
        self._is_done = is_done
        self._act, self._take_back = act, take_back
        self._done, self._refused = done, refused

    def redo(self) -> None:
        """Correct."""
        if self._is_done:
            self._is_done = False
            return
        self._run(self._act)

    def undo(self) -> None:
        """Take it back."""
        self._run(self._take_back)

    def _run(self, change: Callable[[], None]) -> None:
        try:
            change()
        except InputError as error:
            self.setObsolete(True)
            self._refused(str(error))
        self._done()
