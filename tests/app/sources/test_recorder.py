"""Every frame of a stream is in the recording or counted as lost."""

import resource
import threading
import time

import numpy as np
import pytest
from recorded import noisy

from app.sources.recorder import LEAST_QUEUE, Recorder, RecorderFigures
from app.sources.source import SourceFrame, SourceSetting
from app.sources.stream import Stream
from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.output.recording.recording_writer import RecordingWriter

WAIT_S = 60.0


class Silent:
    """A source without frames: the tests pass the frames on themselves."""

    kind, name = "virtual", "silent"

    def open(self) -> None:
        """Do nothing."""

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Return none."""
        return None

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return one."""
        return (SourceSetting("exposure_ms", "Exposure", "ms", 0.1, 50.0, 0.1, 4.0),)

    def close(self) -> None:
        """Do nothing."""


class HandedOn(Stream):
    """A stream without a thread."""

    def __init__(self) -> None:
        super().__init__(Silent())

    def hand_on(self, number: int, rgb: PixelArray | None = None) -> None:
        """Pass a frame to the readers, as the capture thread does."""
        self._hand_on(
            SourceFrame(noisy(number) if rgb is None else rgb, number, 50.0 + 0.1 * number)
        )


@pytest.fixture
def stream():
    return HandedOn()


def ended(recorder: Recorder) -> RecorderFigures:
    """Wait until a recording has stopped by itself."""
    limit = time.monotonic() + WAIT_S
    while not recorder.figures().finished and time.monotonic() < limit:
        time.sleep(0.005)
    return recorder.figures()


@pytest.mark.function("Record every frame without loss")
def test_every_frame_is_written_and_the_figures_say_so(stream, tmp_path):
    path = tmp_path / "a.gplrec"
    recorder = Recorder(stream, path, RecordingHeader(serial="A"))
    recorder.start()
    for number in range(3, 23):
        stream.hand_on(number)
    assert recorder.stop()
    figures = recorder.figures()
    assert (figures.frames, figures.lost) == (20, 0)
    assert figures.failure is None
    assert figures.finished
    assert figures.seconds == pytest.approx(1.9)
    # Closing adds less than a hundred bytes.
    assert 0 <= path.stat().st_size - figures.size_bytes < 100
    stream.hand_on(23)
    with Recording.open(path) as recording:
        assert recording.numbers.tolist() == list(range(3, 23))
        assert not recording.truncated
        assert all(np.array_equal(recording.frame(k).rgb, noisy(k + 3)) for k in range(20))


def test_a_slow_disk_loses_frames_and_reports_how_many(stream, tmp_path, monkeypatch, caplog):
    busy, free = threading.Event(), threading.Event()
    append = RecordingWriter.append

    def wait_and_append(
        writer: RecordingWriter, rgb: PixelArray, number: int, time_s: float
    ) -> None:
        busy.set()
        assert free.wait(WAIT_S)
        append(writer, rgb, number, time_s)

    monkeypatch.setattr(RecordingWriter, "append", wait_and_append)
    monkeypatch.setattr("app.sources.recorder.QUEUE_BYTES", 0)
    recorder = Recorder(stream, tmp_path / "a.gplrec", RecordingHeader())
    recorder.start()
    stream.hand_on(0)
    assert busy.wait(WAIT_S)
    for number in range(1, 20):
        stream.hand_on(number)
    assert recorder.figures().lost == 20 - LEAST_QUEUE
    assert "too slow" in caplog.text
    free.set()
    assert recorder.stop()
    figures = recorder.figures()
    assert (figures.frames, figures.lost) == (LEAST_QUEUE, 20 - LEAST_QUEUE)
    with Recording.open(recorder.path) as recording:
        assert (len(recording), recording.lost) == (LEAST_QUEUE, 20 - LEAST_QUEUE)


def test_half_the_rate_keeps_every_second_frame_and_loses_none(stream, tmp_path):
    recorder = Recorder(stream, tmp_path / "a.gplrec", RecordingHeader())
    recorder.start()
    for number in range(4):
        stream.hand_on(number)
    recorder.halve_rate()
    for number in (*range(4, 10), *range(14, 16)):  # of 11 and 13, 14 replaces one
        stream.hand_on(number)
    assert recorder.stop()
    figures = recorder.figures()
    assert (figures.frames, figures.lost) == (8, 1)
    with Recording.open(recorder.path) as recording:
        assert recording.lost == 1
        times = [recording.frame(k).time_s for k in range(len(recording))]
    assert times == pytest.approx([50.0, 50.1, 50.2, 50.3, 50.5, 50.7, 50.9, 51.4])


def test_a_reopened_source_continues_in_the_same_recording(stream, tmp_path):
    recorder = Recorder(stream, tmp_path / "a.gplrec", RecordingHeader())
    recorder.start()
    for number in (7, 8, 0, 1, 3):
        stream.hand_on(number)
    assert recorder.stop()
    assert recorder.figures().lost == 1
    with Recording.open(recorder.path) as recording:
        assert recording.numbers.tolist() == [7, 8, 9, 10, 12]


def test_a_camera_that_changes_its_size_ends_the_recording(stream, tmp_path):
    recorder = Recorder(stream, tmp_path / "a.gplrec", RecordingHeader())
    recorder.start()
    stream.hand_on(0)
    stream.hand_on(1, noisy(1, (12, 16)))
    figures = ended(recorder)
    assert "the size or bit depth of the images has changed" in figures.failure
    assert figures.frames == 1
    stream.hand_on(2)
    assert recorder.stop()
    assert recorder.figures().frames == 1


def test_a_full_disk_gives_one_sentence_and_keeps_earlier_frames(stream, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        recorder = Recorder(stream, tmp_path / "a.gplrec", RecordingHeader())
        recorder.start()
        for number in range(30):
            stream.hand_on(number)
        figures = ended(recorder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    recorder.stop()
    assert "too large for this disk" in figures.failure
    assert 0 < figures.frames < 30
    with Recording.open(recorder.path) as recording:
        assert len(recording) == figures.frames
        last = len(recording) - 1
        assert np.array_equal(recording.frame(last).rgb, noisy(last))
