"""A thread that answers the newest question only, for what must follow the hand."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.sources.stopping import join

Question = TypeVar("Question")
Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True)
class Answered(Generic[Question, Answer]):
    """An answer, or the error that came in its place, with its question."""

    question: Question
    answer: Answer | None
    error: Exception | None


class NewestWins(Generic[Question, Answer]):
    """Answers questions in a thread of its own; a question that waits gives way to a newer one.

    Parameters
    ----------
    function : callable
        From question to answer; called in the thread.
    name : str
        Of the thread.
    """

    def __init__(self, function: Callable[[Question], Answer], *, name: str) -> None:
        self._function = function
        self._change = threading.Condition()
        self._waiting: list[Question] = []
        self._done: list[Answered[Question, Answer]] = []
        self._busy = self._stopped = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def ask(self, question: Question) -> None:
        """Ask; what was asked before and is not begun is dropped."""
        with self._change:
            self._waiting[:] = [question]
            self._change.notify()

    def take(self) -> Answered[Question, Answer] | None:
        """Return the newest answer that was not taken yet."""
        with self._change:
            return self._done.pop() if self._done else None

    @property
    def idle(self) -> bool:
        """Whether nothing waits, is worked at, or is to be taken."""
        with self._change:
            return not (self._waiting or self._busy or self._done)

    def stop(self, timeout_s: float = 5.0) -> bool:
        """Let the thread end after what it is at; return whether it has."""
        with self._change:
            self._stopped = True
            self._change.notify()
        return join(self._thread, timeout_s)

    def _work(self) -> None:
        while True:
            with self._change:
                self._busy = False
                self._change.wait_for(lambda: self._waiting or self._stopped)
                if self._stopped:
                    return
                question = self._waiting.pop()
                self._busy = True
            answered = self._answer(question)
            with self._change:
                self._done[:] = [answered]
            del question, answered  # the thread would keep them until the next

    def _answer(self, question: Question) -> Answered[Question, Answer]:
        try:
            return Answered(question, self._function(question), None)
        except Exception as error:  # handed to the thread that asks, which shows or raises it
            return Answered(question, None, error)
