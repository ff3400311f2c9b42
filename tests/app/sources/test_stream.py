"""Frames reach their readers, losses are counted, and threads stop on request."""

import queue
import time

import numpy as np
import pytest

from app.sources.source import SourceFrame, SourceLost, SourceSetting
from app.sources.stream import Stream
from gelpolight_core.base.errors import InputError

WAIT_S = 60.0  # much longer than a busy machine needs; only a failing test waits so long


def frame(number: int, *, settled: bool = True, time_s: float | None = None) -> SourceFrame:
    """Return a tiny frame that was just made."""
    return SourceFrame(
        np.zeros((2, 3, 3), np.uint8),
        number,
        time.monotonic() if time_s is None else time_s,
        settled,
    )


class ByHand:
    """A source whose frames come from the test; an exception instead of a frame is raised."""

    kind, name = "virtual", "by hand"

    def __init__(self) -> None:
        self.next: queue.Queue[SourceFrame | Exception] = queue.Queue()
        self.calls: list[str] = []

    def open(self) -> None:
        """Record the call."""
        self.calls.append("open")

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Return the item of the test."""
        try:
            item = self.next.get(timeout=min(timeout_s, 0.02))
        except queue.Empty:
            return None
        if isinstance(item, Exception):
            raise item
        return item

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return none."""
        return ()

    def close(self) -> None:
        """Record the call."""
        self.calls.append("close")


@pytest.fixture
def source():
    return ByHand()


@pytest.fixture
def stream(source):
    stream = Stream(source)
    stream.start()
    yield stream
    stream.stop()


def lost_sentence(stream: Stream) -> str:
    """Wait until a stream is lost; return why."""
    limit = time.monotonic() + WAIT_S
    while time.monotonic() < limit:
        if (lost := stream.figures().lost) is not None:
            return lost
        time.sleep(0.005)
    raise AssertionError("the stream was not lost")


def test_missing_frames_are_counted(source, stream):
    numbers = [0, 1, 4, 5, 9]
    capture = stream.capture(len(numbers))
    for number in numbers:
        source.next.put(frame(number))
    capture.result(WAIT_S)
    assert stream.figures().dropped == 5


def test_a_capture_contains_only_settled_frames_after_the_call(source, stream):
    early = time.monotonic()
    capture = stream.capture(2)
    source.next.put(frame(0, time_s=early))
    source.next.put(frame(1, settled=False))
    for number in (2, 3, 4):
        source.next.put(frame(number))
    assert [f.number for f in capture.result(WAIT_S)] == [2, 3]


def test_a_capture_takes_the_newest_frames_of_the_still_scene_first(source):
    """Who clicks and lifts the object at once loses nothing."""
    stream = Stream(source, keeps_seen=True)
    stream.start()
    start = time.monotonic()
    seen: queue.Queue[SourceFrame] = queue.Queue()
    stream.add_tap(seen.put)
    for number in range(6):
        source.next.put(frame(number, settled=number != 1, time_s=start + 0.001 * (number + 1)))
        seen.get(timeout=WAIT_S)
    enough = stream.capture(2, (start, start + 0.0055))  # 0 to 4, without the lift
    assert [f.number for f in enough.result(WAIT_S)] == [3, 4]
    all_four = stream.capture(4, (start, start + 1.0))
    assert [f.number for f in all_four.result(WAIT_S)] == [2, 3, 4, 5]
    assert not stream.capture(5, (start, start + 1.0)).done()  # 0 was made before a change
    more = stream.capture(3, (start + 0.0045, start + 0.0055))
    assert not more.done()
    for number in (6, 7):
        source.next.put(frame(number))
    assert [f.number for f in more.result(WAIT_S)] == [4, 6, 7]
    stream.stop()
    stream.start()
    fresh = stream.capture(1, (start, time.monotonic()))  # another picture, perhaps
    source.next.put(frame(0))
    assert [f.number for f in fresh.result(WAIT_S)] == [0]
    stream.stop()


def test_a_capture_fails_when_the_stream_is_stopped(source):
    stream = Stream(source)
    with pytest.raises(SourceLost, match="stopped"):
        stream.capture(1).result(WAIT_S)
    stream.start()
    waiting = stream.capture(16)
    stream.stop()
    with pytest.raises(SourceLost, match="stopped"):
        waiting.result(WAIT_S)
    with pytest.raises(SourceLost):
        stream.capture(1).result(WAIT_S)


def test_a_lost_source_reports_why_and_can_be_reopened(source, stream):
    waiting = stream.capture(16)
    source.next.put(frame(0))
    source.next.put(SourceLost("it was unplugged", where="camera", advice="Plug it in"))
    assert lost_sentence(stream) == "camera: it was unplugged. Plug it in."
    with pytest.raises(SourceLost, match="unplugged"):
        waiting.result(WAIT_S)
    with pytest.raises(SourceLost, match="unplugged"):
        stream.capture(1).result(WAIT_S)
    stream.stop()
    stream.start()
    again = stream.capture(1)
    source.next.put(frame(0))
    assert len(again.result(WAIT_S)) == 1
    assert stream.figures().lost is None
    stream.stop()
    assert source.calls == ["open", "close", "open", "close"]


def test_a_source_that_is_silent_or_faulty_or_cannot_be_opened_reports_why(
    source, caplog, monkeypatch
):
    def refuse() -> None:
        raise InputError("it is in use", where="camera", advice="Close the other program")

    monkeypatch.setattr("app.sources.stream.SILENCE_S", 0.05)
    stream = Stream(source)
    for item, words in (
        (frame(0), "no image has arrived"), (ZeroDivisionError(), "internal error"),
        (None, "in use"),
    ):  # fmt: skip
        if item is None:
            source.open = refuse
        else:
            source.next.put(item)
        stream.start()
        assert words in lost_sentence(stream)
        stream.stop()
    assert "ZeroDivisionError" in caplog.text


def test_every_reader_gets_every_frame_until_it_fails(source, stream, caplog):
    seen: list[int] = []

    def broken(item: SourceFrame) -> None:
        raise RuntimeError("broken reader")

    stream.add_tap(broken)
    stream.add_tap(lambda item: seen.append(item.number))
    capture = stream.capture(3)
    for number in range(3):
        source.next.put(frame(number))
    capture.result(WAIT_S)
    assert seen == [0, 1, 2]
    assert caplog.text.count("Traceback") == 1
