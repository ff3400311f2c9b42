"""Only the newest request is processed; no older result follows."""

import threading
import time

from app.services.newest_wins import NewestWins


def finished_of(worker: NewestWins, timeout_s: float = 60.0):  # type: ignore[no-untyped-def]
    """Return the next result."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        finished = worker.take()
        if finished is not None:
            return finished
        time.sleep(0.005)
    raise AssertionError("no result came")


def test_a_newer_request_replaces_a_waiting_one():
    gate, began, asked = threading.Event(), threading.Event(), []

    def slow(request: int) -> int:
        asked.append(request)
        began.set()
        assert gate.wait(60.0)
        return 10 * request

    worker = NewestWins(slow, name="test-newest")
    worker.submit(1)
    assert began.wait(60.0)
    for request in range(2, 20):
        worker.submit(request)
    gate.set()
    while finished_of(worker).request != 19:
        pass
    assert asked == [1, 19]
    assert worker.idle
    assert worker.stop()


def test_an_error_is_passed_on_and_the_thread_continues():
    def fails(request: int) -> float:
        return 1.0 / request

    worker = NewestWins(fails, name="test-errors")
    worker.submit(0)
    assert isinstance(finished_of(worker).error, ZeroDivisionError)
    worker.submit(2)
    assert finished_of(worker).result == 0.5
    assert worker.stop()
