"""A thread that answers only the newest question, for results that must follow the pointer."""

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
    """An answer, or the error raised instead, with its question."""

    question: Question
    answer: Answer | None
    error: Exception | None


class NewestWins(Generic[Question, Answer]):
    """Answers questions in a separate thread; a newer question replaces a waiting one.

    Parameters
    ----------
    function : callable
        Maps a question to its answer; called in the thread.
    name : str
        Name of the thread.
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
        """Ask a question; an earlier one that is not yet started is dropped."""
        with self._change:
            self._waiting[:] = [question]
            self._change.notify()

    def take(self) -> Answered[Question, Answer] | None:
        """Return the newest answer that was not returned yet."""
        with self._change:
            return self._done.pop() if self._done else None

    @property
    def idle(self) -> bool:
        """Whether no question waits, runs, or has an answer to return."""
        with self._change:
            return not (self._waiting or self._busy or self._done)

    def stop(self, timeout_s: float = 5.0) -> bool:
        """Stop the thread after its present question; return whether it has stopped."""
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
            del question, answered  # the thread would keep them until the next question

    def _answer(self, question: Question) -> Answered[Question, Answer]:
        try:
            return Answered(question, self._function(question), None)
        except Exception as error:  # passed to the asking thread, which shows or raises it
            return Answered(question, None, error)
