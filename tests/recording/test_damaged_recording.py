"""A damaged recording gives correct frames or an error; a killed program loses at most one."""

import errno
import os
import resource
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import noisy, write_recording

from gelpolight_core.errors import InputError
from gelpolight_core.recording import layout, reader
from gelpolight_core.recording.reader import Recording
from gelpolight_core.recording.recording import VERSION, RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the bytes of a recording of three frames."""
    path = tmp_path_factory.mktemp("whole") / "a.gplrec"
    write_recording(path, header=RecordingHeader(serial="A", started="2026-01-01T00:00:00+00:00"))
    return path.read_bytes()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged") / "a.gplrec"


def right_frames(path: Path) -> set[int]:
    """Return the readable frames; each of them must be correct."""
    found = set()
    with Recording.open(path) as recording:
        assert recording.header.serial == "A"
        for index in range(len(recording)):
            try:
                frame = recording.frame(index)
            except InputError:
                continue
            assert np.array_equal(frame.rgb, noisy(frame.number))
            assert frame.time_s == 100.0 + frame.number / 50.0
            found.add(frame.number)
        if len(recording) < 3:
            assert recording.truncated
    return found


@settings(deadline=None, max_examples=150)
@given(data=st.data(), value=st.integers(1, 255))
def test_a_changed_byte_spoils_one_frame_at_most_or_is_refused(whole, place, data, value):
    at = data.draw(st.integers(0, len(whole) - 1))
    spoilt = bytearray(whole)
    spoilt[at] ^= value
    place.write_bytes(spoilt)
    try:
        assert len(right_frames(place)) >= 2
    except InputError as error:
        assert at < whole.index(layout.FRAME_MAGIC), f"byte {at}: {error}"


@pytest.mark.parametrize("search_bytes", [8, 9, 100, 10_000])
def test_after_damage_the_next_frame_is_found(whole, place, monkeypatch, search_bytes):
    """Wherever the file is cut into the parts that are searched."""
    monkeypatch.setattr(reader, "SEARCH_BYTES", search_bytes)
    spoilt = bytearray(whole)
    spoilt[whole.index(layout.FRAME_MAGIC) + 20] ^= 1
    place.write_bytes(spoilt)
    assert right_frames(place) == {1, 2}


@settings(deadline=None, max_examples=80)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_file_cut_short_keeps_the_frames_before_the_cut(whole, place, share):
    size = int(share * len(whole))
    place.write_bytes(whole[:size])
    frames, begin = 0, whole.index(layout.FRAME_MAGIC)
    while (end := whole.find(layout.FRAME_MAGIC, begin + 8)) > 0 and end <= size:
        frames, begin = frames + 1, end
    if size < whole.index(layout.FRAME_MAGIC) - 8:
        with pytest.raises(InputError):
            Recording.open(place)
    else:
        assert right_frames(place) == set(range(frames))


def test_a_newer_version_is_refused_in_one_line(whole, place):
    newer = bytearray(whole)
    newer[layout.HEAD_AT + 8 : layout.HEAD_AT + 12] = struct.pack("<I", VERSION + 1)
    place.write_bytes(newer)
    with pytest.raises(InputError, match=f"has version {VERSION + 1}, but this program"):
        Recording.open(place)


def test_a_full_disk_ends_a_recording_with_what_came_before(tmp_path):
    path = tmp_path / "a.gplrec"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    writer = RecordingWriter(path, RecordingHeader(serial="A"))
    writer.append(noisy(0), 0, 100.0)
    resource.setrlimit(resource.RLIMIT_FSIZE, (writer.size_bytes + 500, before[1]))
    try:
        with pytest.raises(InputError, match=r"a\.gplrec: The file is too large for this disk"):
            writer.append(noisy(1), 1, 100.02)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    writer.close(1)
    with Recording.open(path) as recording:
        assert recording.numbers.tolist() == [0]
        assert recording.lost == 1
        assert not recording.truncated
        assert np.array_equal(recording.frame(0).rgb, noisy(0))


def test_a_failing_disk_gives_one_message_and_earlier_frames_are_kept(tmp_path, monkeypatch):
    """Not even the incomplete frame can be removed."""
    path = tmp_path / "a.gplrec"

    def fail(*_: object) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with RecordingWriter(path, RecordingHeader(serial="A")) as writer:
        writer.append(noisy(0), 0, 100.0)
        with monkeypatch.context() as patch:
            patch.setattr(os, "pwrite", fail)
            patch.setattr(os, "ftruncate", fail)
            with pytest.raises(InputError, match=r"a\.gplrec: The file cannot be written"):
                writer.append(noisy(1), 1, 100.02)
    with Recording.open(path) as recording:
        assert recording.numbers.tolist() == [0]
        assert np.array_equal(recording.frame(0).rgb, noisy(0))
