"""A recording plays in its own time, stands still, goes anywhere, and passes over damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded import noisy, write_recording

from app.sources.listing import recordings
from app.sources.recording import RecordingSource
from app.sources.source import Frame, SourceLost
from app.sources.stream import Stream
from gelpolight_core.errors import InputError
from gelpolight_core.recording import layout

WAIT_S = 60.0


class Clock:
    """A clock that goes on only while somebody waits."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        """Return the time."""
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Have the source look at a clock of the test's."""
    clock = Clock()
    monkeypatch.setattr("app.sources.recording.time", clock)
    return clock


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_recording(tmp_path / "press.gplrec", frames=6, rate_hz=10.0)
    return tmp_path / "press.gplrec"


def watch(source: RecordingSource, clock: Clock, seconds: float) -> list[tuple[float, int]]:
    """Return what comes within some time: when, and which picture of the recording."""
    began_s, seen = clock.now_s, []
    for tick in range(round(seconds / 0.01) + 1):
        clock.now_s = began_s + 0.01 * tick
        while (frame := source.frame(0.0)) is not None:
            seen.append((round(clock.now_s - began_s, 2), shown(frame)))
    return seen


def shown(frame: Frame) -> int:
    """Return which picture a frame is."""
    return next(k for k in range(6) if np.array_equal(frame.rgb, noisy(k)))


def new_pictures(seen: list[tuple[float, int]]) -> list[tuple[float, int]]:
    """Leave out what came again while the picture stood."""
    return [item for k, item in enumerate(seen) if k == 0 or item[1] != seen[k - 1][1]]


def test_it_plays_in_its_own_time_and_begins_again(path: Path, clock: Clock) -> None:
    source = RecordingSource(path)
    source.open()
    assert source.size == (32, 24)
    seen = watch(source, clock, 0.85)
    assert [k for _, k in seen] == [0, 1, 2, 3, 4, 5, 0, 1, 2]
    assert [t for t, _ in seen] == pytest.approx([0.1 * k for k in range(9)], abs=0.011)
    source.close()


@pytest.mark.parametrize(("speed", "count"), [(0.5, 4), (0.1, 1), (1.0, 7)])
def test_slower_than_life_every_frame_is_shown_longer(
    path: Path, clock: Clock, speed: float, count: int
) -> None:
    source = RecordingSource(path, speed=speed)
    source.open()
    assert len(new_pictures(watch(source, clock, 0.65))) == count
    source.close()


def test_hurried_and_late_it_passes_over_frames_and_counts_them(path: Path, clock: Clock) -> None:
    source = RecordingSource(path, speed=4.0)
    source.open()
    assert source.frame(0.0).number == 0
    clock.now_s += 0.08
    frame = source.frame(0.0)
    assert (frame.number, shown(frame)) == (3, 3)
    source.close()


def test_in_its_own_time_no_frame_is_passed_over_however_late(path: Path, clock: Clock) -> None:
    source = RecordingSource(path)
    source.open()
    seen = []
    for _ in range(6):
        seen.append(source.frame(0.0))
        clock.now_s += 5.0
    assert [shown(frame) for frame in seen] == [0, 1, 2, 3, 4, 5]
    assert [frame.number for frame in seen] == [0, 1, 2, 3, 4, 5]
    source.close()


def test_without_looping_it_stands_on_the_last_frame_until_it_is_played_again(
    path: Path, clock: Clock
) -> None:
    source = RecordingSource(path, loop=False)
    source.open()
    assert [k for _, k in new_pictures(watch(source, clock, 2.0))] == [0, 1, 2, 3, 4, 5]
    assert not source.playback().playing
    assert source.playback().position == 5
    source.play()
    assert watch(source, clock, 0.15) == [(0.0, 0), (0.1, 1)]
    source.close()


def test_standing_still_the_very_same_picture_comes_again(path: Path, clock: Clock) -> None:
    """So that captures and views go on, and the stream is not taken for lost."""
    source = RecordingSource(path, playing=False)
    source.open()
    first = source.frame(0.0)
    assert source.frame(0.0) is None
    clock.now_s += 0.25
    again = source.frame(0.0)
    assert again.rgb is first.rgb
    assert again.number == first.number + 1
    assert again.time_s > first.time_s
    source.close()


def test_it_goes_to_any_frame_and_steps(path: Path, clock: Clock) -> None:
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
    assert (playback.position, playback.count, playback.number) == (0, 6, 0)
    assert playback.duration_s == pytest.approx(0.5)
    assert (playback.lost, playback.truncated) == (0, False)
    source.close()


@pytest.mark.parametrize("frames", [1, 2])
def test_a_short_recording_is_played_without_haste(
    tmp_path: Path, clock: Clock, frames: int
) -> None:
    write_recording(tmp_path / "a.gplrec", frames=frames, rate_hz=10.0)
    source = RecordingSource(tmp_path / "a.gplrec")
    source.open()
    assert len(watch(source, clock, 0.95)) == 10
    source.close()


def test_the_speed_is_kept_within_its_range_and_read_back(path: Path) -> None:
    source = RecordingSource(path)
    assert source.set("speed", 9.0) == 4.0
    assert source.set("speed", 0.0) == 0.1
    assert source.settings()[0].value == 0.1
    with pytest.raises(InputError, match="it has no setting exposure_ms"):
        source.set("exposure_ms", 1.0)


def spoil(path: Path, frame: int) -> None:
    """Change a byte in the middle of a frame's pixels."""
    content = bytearray(path.read_bytes())
    at = -1
    for _ in range(frame + 1):
        at = content.index(layout.FRAME_MAGIC, at + 1)
    mark = layout.unpack_mark(bytes(content[at : at + layout.MARK_LIMIT]))
    assert mark is not None
    content[mark.strips[0].place + 50] ^= 1
    path.write_bytes(content)


def test_a_damaged_frame_is_passed_over_and_counted(path: Path, clock: Clock) -> None:
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


def test_a_recording_of_which_nothing_is_left_is_refused(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.gplrec", frames=2)
    for frame in range(2):
        spoil(tmp_path / "a.gplrec", frame)
    stream = Stream(RecordingSource(tmp_path / "a.gplrec"))
    stream.start()
    with pytest.raises(InputError, match="frame 1 is damaged"):
        stream.capture(1).result(WAIT_S)
    stream.stop()


def test_a_recording_without_frames_is_refused(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.gplrec", frames=0)
    with pytest.raises(InputError, match="the recording holds no frames"):
        RecordingSource(tmp_path / "a.gplrec").open()


def test_a_closed_recording_gives_no_frames_and_can_be_opened_again(path: Path) -> None:
    source = RecordingSource(path)
    source.open()
    source.close()
    with pytest.raises(SourceLost, match="it is closed"):
        source.frame(0.0)
    source.open()
    assert shown(source.frame(0.0)) == 0
    source.close()


def test_a_stream_takes_frames_of_a_recording_that_stands_still(path: Path) -> None:
    stream = Stream(RecordingSource(path, playing=False))
    stream.start()
    frames = stream.capture(2).result(WAIT_S)
    stream.stop()
    assert [shown(frame) for frame in frames] == [0, 0]


def test_the_list_names_the_recordings_that_are_there(path: Path) -> None:
    (info,) = recordings([path, path.with_name("gone.gplrec")])()
    assert (info.kind, info.name, info.detail) == ("recording", "press", str(path.parent))
    source = info.open()
    assert (source.kind, source.name) == (info.kind, info.name)
