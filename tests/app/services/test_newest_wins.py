"""Only the newest question is answered; no older answer follows."""

from __future__ import annotations

import threading
import time
import weakref

from app.services.newest_wins import NewestWins


def answer_of(worker: NewestWins, timeout_s: float = 5.0):  # type: ignore[no-untyped-def]
    """Return the next answer."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        answered = worker.take()
        if answered is not None:
            return answered
        time.sleep(0.005)
    raise AssertionError("no answer came")


def test_a_newer_question_replaces_a_waiting_one() -> None:
    gate, began, asked = threading.Event(), threading.Event(), []

    def slow(question: int) -> int:
        asked.append(question)
        began.set()
        assert gate.wait(5.0)
        return 10 * question

    worker = NewestWins(slow, name="test-newest")
    worker.ask(1)
    assert began.wait(5.0)
    for question in range(2, 20):
        worker.ask(question)
    gate.set()
    while answer_of(worker).question != 19:
        pass
    assert asked == [1, 19]
    assert worker.idle
    assert worker.stop()


def test_an_error_is_passed_on_and_the_thread_continues() -> None:
    def fails(question: int) -> float:
        return 1.0 / question

    worker = NewestWins(fails, name="test-errors")
    worker.ask(0)
    assert isinstance(answer_of(worker).error, ZeroDivisionError)
    worker.ask(2)
    assert answer_of(worker).answer == 0.5
    assert worker.stop()


def test_a_stopped_worker_leaves_no_thread() -> None:
    worker = NewestWins(lambda question: question, name="test-stops")
    assert worker.stop()
    assert "test-stops" not in {thread.name for thread in threading.enumerate()}


def test_an_answer_is_not_kept_after_it_was_read() -> None:
    class Heavy:
        pass

    worker = NewestWins(lambda _question: Heavy(), name="test-kept")
    worker.ask(0)
    kept = weakref.ref(answer_of(worker).answer)
    end = time.monotonic() + 5.0
    while kept() is not None and time.monotonic() < end:
        time.sleep(0.005)
    assert kept() is None
    assert worker.stop()
