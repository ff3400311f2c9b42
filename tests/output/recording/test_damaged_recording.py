"""A damaged recording gives right frames or an error; a damaged end costs only the last frames."""

import errno
import os
import resource
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import noisy, write_recording

from gelpolight_core.base.errors import InputError
from gelpolight_core.output.recording import recording_writer
from gelpolight_core.output.recording.recording_format import VERSION, RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.output.recording.recording_writer import RecordingWriter


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the bytes of a recording of three frames."""
    path = tmp_path_factory.mktemp("whole") / "a.gplrec"
    write_recording(path, header=RecordingHeader(serial="A", started="2026-01-01T00:00:00+00:00"))
    return path.read_bytes()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged") / "a.gplrec"


def right_frames(path: Path) -> list[int]:
    """Return the readable frames; each of them must have its own pixels."""
    found = []
    with Recording.open(path) as recording:
        assert recording.header.serial
        for index in range(len(recording)):
            try:
                frame = recording.frame(index)
            except InputError:
                continue
            assert any(np.array_equal(frame.rgb, noisy(number)) for number in range(3))
            found.append(frame.number)
        if len(recording) < 3:
            assert recording.truncated
    return found


def page_ends(path: Path) -> list[int]:
    """Return where the pixels of each frame end in its file."""
    with tifffile.TiffFile(path) as file:
        return [page.dataoffsets[0] + page.databytecounts[0] for page in file.pages]


@settings(deadline=None, max_examples=150)
@given(data=st.data(), value=st.integers(1, 255))
def test_no_changed_byte_gives_wrong_pixels(whole, place, data, value):
    at = data.draw(st.integers(0, len(whole) - 1))
    spoilt = bytearray(whole)
    spoilt[at] ^= value
    place.write_bytes(spoilt)
    with suppress(InputError):
        right_frames(place)


def test_damage_of_pixels_or_of_a_description_costs_only_its_frame(whole, place):
    place.write_bytes(whole)
    for at in (page_ends(place)[1] - 20, whole.index(b'"number": 1') + 10):
        place.write_bytes(whole[:at] + b"x" + whole[at + 1 :])
        assert right_frames(place) == [0, 2]


@pytest.mark.function("Read what is whole of a damaged recording")
@settings(deadline=None, max_examples=80)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_file_cut_short_keeps_the_frames_before_the_cut(whole, place, share):
    place.write_bytes(whole)
    ends = page_ends(place)
    size = int(share * len(whole))
    place.write_bytes(whole[:size])
    if size < ends[0]:
        with pytest.raises(InputError):
            Recording.open(place)
    else:
        complete = sum(end <= size for end in ends)
        # The description of the last frame is written again when the recording is closed.
        assert len(right_frames(place)) == min(complete, 2)


def test_a_newer_version_is_refused_in_one_line(whole, place):
    place.write_bytes(whole.replace(f'"version": {VERSION}'.encode(), b'"version": 9'))
    with pytest.raises(InputError, match="has version 9, but this program"):
        Recording.open(place)


def test_a_full_disk_ends_a_recording_with_what_came_before(tmp_path):
    path = tmp_path / "a.gplrec"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    recording = RecordingWriter(path, RecordingHeader(serial="A"))
    recording.append(noisy(0), 0, 100.0)
    resource.setrlimit(resource.RLIMIT_FSIZE, (recording.size_bytes + 500, before[1]))
    try:
        with pytest.raises(InputError, match=r"a\.gplrec: The file is too large for this disk"):
            recording.append(noisy(1), 1, 100.02)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    recording.close(1)
    with Recording.open(path) as kept:
        assert kept.numbers.tolist() == [0]
        assert kept.truncated
        assert np.array_equal(kept.frame(0).rgb, noisy(0))


def test_a_failing_disk_gives_one_message_and_earlier_frames_are_kept(tmp_path, monkeypatch):
    path = tmp_path / "a.gplrec"

    def fail(*_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(recording_writer, "SYNC_S", 0.0)
    with RecordingWriter(path, RecordingHeader(serial="A")) as recording:
        recording.append(noisy(0), 0, 100.0)
        monkeypatch.setattr(os, "fdatasync", fail)
        with pytest.raises(InputError, match=r"a\.gplrec: The file cannot be written"):
            recording.append(noisy(1), 1, 100.02)
    with Recording.open(path) as kept:
        assert kept.truncated
        assert np.array_equal(kept.frame(0).rgb, noisy(0))
