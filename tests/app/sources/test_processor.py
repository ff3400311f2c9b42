"""A processor works on the newest frame; failures are ordinary results."""

import threading

import numpy as np
import pytest

from app.sources.mailbox import Mailbox
from app.sources.processor import Failure, Outcome, Processor
from app.sources.source import Frame
from gelpolight_core.errors import InputError

WAIT_S = 60.0


def frame(number: int) -> Frame:
    return Frame(np.zeros((2, 3, 3), np.uint8), number, 0.0)


def number_of(item: Frame) -> int:
    return item.number


class Line:
    """A processor between two mailboxes."""

    def __init__(self) -> None:
        self.inbox: Mailbox[Frame] = Mailbox()
        self.outbox: Mailbox[Outcome[int] | Failure] = Mailbox()
        self.processor = Processor(self.inbox, number_of, self.outbox)

    def result(self, number: int) -> Outcome[int] | Failure:
        """Process a frame."""
        self.inbox.put(frame(number))
        item = self.outbox.take(WAIT_S)
        return item


@pytest.fixture
def line():
    line = Line()
    line.processor.start()
    yield line
    line.processor.stop()


def test_a_result_of_a_function_that_was_replaced_meanwhile_is_dropped(line):
    begun, go_on = threading.Event(), threading.Event()

    def slow(item: Frame) -> int:
        begun.set()
        assert go_on.wait(WAIT_S)
        return -1

    line.processor.replace(slow)
    line.inbox.put(frame(0))
    assert begun.wait(WAIT_S)
    newest = line.processor.replace(number_of)
    line.inbox.put(frame(1))
    go_on.set()
    item = line.outbox.take(WAIT_S)
    assert isinstance(item, Outcome)
    assert (item.value, item.generation) == (1, newest)
    assert line.outbox.take() is None


def test_errors_are_reported_each_time_and_the_thread_continues(line, caplog):
    def refuse(item: Frame) -> int:
        raise InputError("it is dark", where="image", advice="Switch the LEDs on")

    line.processor.replace(refuse)
    item = line.result(0)
    assert isinstance(item, Failure)
    assert item.sentence == "image: it is dark. Switch the LEDs on."
    line.processor.replace(lambda item: item.number // 0)
    for number in range(3):
        item = line.result(number)
        assert isinstance(item, Failure)
        assert "ZeroDivisionError" in item.sentence
    assert caplog.text.count("Traceback") == 1
    line.processor.replace(number_of)
    assert isinstance(line.result(1), Outcome)
