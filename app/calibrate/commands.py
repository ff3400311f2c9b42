"""What can be undone: a person's decisions about a session's pictures."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QUndoCommand

from gelpolight_core.session.decisions import Decisions


class Decide(QUndoCommand):
    """One change of the decisions; undoing it brings the former ones back.

    Parameters
    ----------
    text : str
        What the history list says.
    before, after : Decisions
        As they were, and as they shall be.
    apply : callable
        Puts decisions in place, on disk first.
    """

    def __init__(
        self, text: str, before: Decisions, after: Decisions, apply: Callable[[Decisions], None]
    ) -> None:
        super().__init__(text)
        self._before, self._after, self._apply = before, after, apply

    def redo(self) -> None:
        """Decide."""
        self._apply(self._after)

    def undo(self) -> None:
        """Take it back."""
        self._apply(self._before)
