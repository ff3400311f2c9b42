"""Only the newest request is worked on; errors are ordinary results."""

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from app.sources.latest import Done, Latest
from gelpolight_core.base.errors import InputError

WAIT_S = 60.0


@pytest.fixture
def made():
    """Return a function that starts a thread with a function, and stop the threads."""
    started = list[Latest[int, Any]]()

    def start(function: Callable[[int], Any]) -> Latest[int, Any]:
        started.append(Latest(function, name="test-latest"))
        started[-1].start()
        return started[-1]

    yield start
    for latest in started:
        assert latest.stop()


def next_of(latest: Latest[int, Any]) -> Done[int, Any]:
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if (done := latest.take()) is not None:
            return done
        time.sleep(0.005)
    raise AssertionError("no result came")


class Held:
    """A function that waits until it may go on."""

    def __init__(self) -> None:
        self.asked = list[int]()
        self.began, self.go_on = threading.Event(), threading.Event()

    def __call__(self, request: int) -> int:
        self.asked.append(request)
        self.began.set()
        assert self.go_on.wait(WAIT_S)
        return 10 * request


def test_a_newer_request_replaces_a_waiting_one(made):
    held = Held()
    latest = made(held)
    latest.submit(1)
    assert held.began.wait(WAIT_S)
    for request in range(2, 20):
        latest.submit(request)
    held.go_on.set()
    while next_of(latest).request != 19:
        pass
    assert held.asked == [1, 19]
    assert latest.idle


def test_a_forgotten_request_is_not_worked_on(made):
    held = Held()
    latest = made(held)
    latest.submit(1)
    assert held.began.wait(WAIT_S)
    latest.submit(2)
    latest.forget()
    held.go_on.set()
    assert next_of(latest).result == 10
    latest.submit(3)
    assert next_of(latest).result == 30
    assert held.asked == [1, 3]


def test_a_result_of_a_function_that_was_replaced_meanwhile_is_dropped(made):
    held = Held()
    latest = made(held)
    latest.submit(0)
    assert held.began.wait(WAIT_S)
    latest.replace(lambda request: -request)
    latest.submit(1)
    held.go_on.set()
    assert next_of(latest) == Done(1, -1)
    assert latest.take() is None


def test_errors_are_reported_each_time_logged_once_and_the_thread_continues(made, caplog):
    def refuse(_request: int) -> int:
        raise InputError("it is dark", where="image", advice="Switch the LEDs on")

    latest = made(refuse)
    latest.submit(1)
    assert next_of(latest).failure == "image: it is dark. Switch the LEDs on."
    latest.replace(lambda request: 1.0 / request)
    for _ in range(3):
        latest.submit(0)
        assert "ZeroDivisionError" in next_of(latest).failure
    assert caplog.text.count("Traceback") == 1
    latest.submit(2)
    assert next_of(latest) == Done(2, 0.5)
