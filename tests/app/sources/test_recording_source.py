"""A recording plays at its own speed, pauses, seeks, and skips damaged frames."""

from pathlib import Path

import numpy as np
import pytest
import tifffile
from recorded import noisy, write_recording

from app.inspect.export import frame_name
from app.sources.recording import RecordingSource
from app.sources.source import SourceFrame
from app.sources.stream import Stream

WAIT_S = 60.0


class Clock:
    """A clock that advances only while somebody waits."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        """Return the time."""
        return self.now_s


@pytest.fixture
def clock(monkeypatch):
    """Make the source use the test's clock."""
    clock = Clock()
    monkeypatch.setattr("app.sources.player.time", clock)
    return clock


@pytest.fixture
def path(tmp_path):
    write_recording(tmp_path / "press.gplrec", frames=6, rate_hz=10.0)
    return tmp_path / "press.gplrec"


def watch(source: RecordingSource, clock: Clock, seconds: float) -> list[tuple[float, int]]:
    """Return the frames that arrive within some time: when, and which image."""
    began_s, seen = clock.now_s, []
    for tick in range(round(seconds / 0.01) + 1):
        clock.now_s = began_s + 0.01 * tick
        while (frame := source.frame(0.0)) is not None:
            seen.append((round(clock.now_s - began_s, 2), shown(frame)))
    return seen


def shown(frame: SourceFrame) -> int:
    """Return the image number of a frame."""
    return next(k for k in range(6) if np.array_equal(frame.rgb, noisy(k)))


def new_images(seen: list[tuple[float, int]]) -> list[tuple[float, int]]:
    """Drop the repeated frames of a pause."""
    return [item for k, item in enumerate(seen) if k == 0 or item[1] != seen[k - 1][1]]


def test_it_plays_at_its_own_speed_and_restarts(path, clock):
    source = RecordingSource(path)
    source.open()
    seen = watch(source, clock, 0.85)
    assert [k for _, k in seen] == [0, 1, 2, 3, 4, 5, 0, 1, 2]
    assert [t for t, _ in seen] == pytest.approx([0.1 * k for k in range(9)], abs=0.011)
    source.close()


def test_late_frames_are_skipped_at_high_speed_only(path, clock):
    fast = RecordingSource(path)
    fast.set_speed(4.0)
    fast.open()
    assert fast.frame(0.0).number == 0
    clock.now_s += 0.08
    frame = fast.frame(0.0)
    assert (frame.number, shown(frame)) == (3, 3)
    fast.close()

    source = RecordingSource(path)
    source.open()
    for number in range(6):
        frame = source.frame(0.0)
        assert (frame.number, shown(frame)) == (number, number)
        clock.now_s += 5.0
    source.close()


def test_without_looping_it_pauses_at_the_last_frame(path, clock):
    source = RecordingSource(path)
    source.set_loop(False)
    source.open()
    assert [k for _, k in new_images(watch(source, clock, 2.0))] == [0, 1, 2, 3, 4, 5]
    assert not source.playback().playing
    assert source.playback().position == 5
    source.play()
    assert watch(source, clock, 0.15) == [(0.0, 0), (0.1, 1)]
    source.close()


@pytest.mark.function("Replay at any speed, pause, step and seek")
def test_it_seeks_to_any_frame_and_steps(path, clock):
    source = RecordingSource(path)
    source.open()
    source.seek(4)
    assert watch(source, clock, 0.12) == [(0.0, 4), (0.1, 5)]
    source.step(-1)
    assert shown(source.frame(0.0)) == 4
    assert not source.playback().playing
    source.step(-3)
    source.step()
    assert shown(source.frame(0.0)) == 2
    source.seek(99)
    assert shown(source.frame(0.0)) == 5
    source.seek(-1)
    assert shown(source.frame(0.0)) == 0
    playback = source.playback()
    assert (playback.position, playback.count) == (0, 6)
    assert playback.duration_s == pytest.approx(0.5)
    source.close()


def spoil(path: Path, frame: int) -> None:
    """Change a byte in the middle of a frame's pixels."""
    content = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        content[file.pages[frame].dataoffsets[0] + 50] ^= 1
    path.write_bytes(content)


def test_a_damaged_frame_is_skipped_and_counted(path, clock):
    spoil(path, 2)
    source = RecordingSource(path)
    source.open()
    assert [k for _, k in watch(source, clock, 0.65)] == [0, 1, 3, 4, 5, 0]
    assert source.playback().damaged == 1
    source.step(-5)
    source.seek(3)
    assert shown(source.frame(0.0)) == 3
    source.step(-1)
    assert [k for _, k in watch(source, clock, 0.01)] == [1]
    source.step(1)
    assert [k for _, k in watch(source, clock, 0.01)] == [3]
    source.close()


def test_a_stream_receives_frames_of_a_paused_recording(path):
    source = RecordingSource(path)
    source.pause()
    stream = Stream(source)
    stream.start()
    frames = stream.capture(2).result(WAIT_S)
    stream.stop()
    assert [shown(frame) for frame in frames] == [0, 0]


def test_an_exported_frame_is_named_after_its_place_in_the_recording_also_in_a_loop(path, clock):
    source = RecordingSource(path)
    source.open()
    names = []
    for tick in range(86):
        clock.now_s += 0.01 * bool(tick)
        while (frame := source.frame(0.0)) is not None:
            assert frame.index == shown(frame)
            names.append(frame_name(frame))
    source.close()
    assert len(names) > 6  # it began again
    assert names[6:8] == ["press-00000.png", "press-00001.png"]
