"""A recording returns exactly what was written: every value, number and time, in any program."""

import json

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from recorded import noisy, write_recording

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording, is_recording
from gelpolight_core.output.recording.recording_writer import RecordingWriter


@st.composite
def frame_series(draw: st.DrawFn) -> list[tuple[PixelArray, int, float]]:
    """Return frames of one size and type, with gaps in their numbers."""
    shape = (draw(st.integers(1, 11)), draw(st.integers(1, 9)), 3)
    kind = draw(st.sampled_from([np.uint8, np.uint16]))
    steps = draw(st.lists(st.integers(1, 2**33), max_size=5))
    numbers = np.cumsum(steps).tolist()
    times = st.floats(allow_nan=False, allow_infinity=False)
    return [(draw(arrays(kind, shape)), number, draw(times)) for number in numbers]


@settings(deadline=None, max_examples=60)
@given(frame_series(), st.integers(0, 9))
def test_whatever_was_written_comes_back(tmp_path_factory, series, lost_at_end):
    path = tmp_path_factory.mktemp("written") / "a.gplrec"
    writer = RecordingWriter(path, RecordingHeader())
    for rgb, number, time_s in series:
        writer.append(rgb, number, time_s)
    writer.close(series[-1][1] + lost_at_end if series else None)
    with Recording.open(path) as recording:
        assert len(recording) == len(series)
        assert not recording.truncated
        for index, (rgb, number, time_s) in enumerate(series):
            frame = recording.frame(index)
            assert frame.rgb.dtype == rgb.dtype
            assert np.array_equal(frame.rgb, rgb)
            assert (frame.number, frame.time_s) == (number, time_s)
            assert (recording.numbers[index], recording.times_s[index]) == (number, time_s)
        if series:
            made = series[-1][1] + lost_at_end - series[0][1] + 1
            assert recording.lost == made - len(series)
            assert recording.size == series[0][0].shape[1::-1]


def test_what_it_says_of_itself_comes_back(tmp_path):
    header = RecordingHeader(
        serial="Sensor Ä/7",
        calibration_id="c1",
        source="bench camera",
        kind="camera",
        settings={"exposure_ms": 4.5, "format": "YUYV", "automatic": False},
        note="first try\nsecond line",
    )
    write_recording(tmp_path / "a.gplrec", header=header)
    with Recording.open(tmp_path / "a.gplrec") as recording:
        assert recording.header == header
    assert is_recording(tmp_path / "a.gplrec")


@pytest.mark.function("Open the frames of a recording with other programs")
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_other_programs_open_its_frames(tmp_path, kind):
    """Through tifffile, and through libtiff in OpenCV: neither needs this program."""
    images = write_recording(tmp_path / "a.gplrec", kind=kind, shape=(50, 41))
    with tifffile.TiffFile(tmp_path / "a.gplrec") as file:
        assert len(file.pages) == len(images)
        for number, (page, rgb) in enumerate(zip(file.pages, images, strict=True)):
            assert np.array_equal(page.asarray(), rgb)
            reported = json.loads(page.tags["ImageDescription"].value)
            assert (reported["number"], reported["time_s"]) == (number, 100.0 + number / 50.0)
    done, theirs = cv2.imreadmulti(str(tmp_path / "a.gplrec"), flags=cv2.IMREAD_UNCHANGED)
    assert done
    assert all(np.array_equal(bgr[..., ::-1], rgb) for bgr, rgb in zip(theirs, images, strict=True))


def test_another_tiff_file_is_no_recording(tmp_path):
    tifffile.imwrite(tmp_path / "a.gplrec", noisy(0), bigtiff=True)
    assert not is_recording(tmp_path / "a.gplrec")
    with pytest.raises(InputError, match="not a recording"):
        Recording.open(tmp_path / "a.gplrec")


def test_noise_of_a_camera_takes_less_than_half_the_space(tmp_path):
    write_recording(tmp_path / "a.gplrec", frames=2, shape=(240, 320))
    assert (tmp_path / "a.gplrec").stat().st_size < 0.5 * 2 * 240 * 320 * 3


def test_a_recording_is_read_while_it_is_still_written(tmp_path):
    with RecordingWriter(tmp_path / "a.gplrec", RecordingHeader()) as writer:
        writer.append(noisy(0), 0, 0.0)
        with Recording.open(tmp_path / "a.gplrec") as recording:
            assert len(recording) == 1
            assert recording.truncated
            assert np.array_equal(recording.frame(0).rgb, noisy(0))


def test_a_recording_never_replaces_a_file(tmp_path):
    (tmp_path / "a.gplrec").write_text("precious")
    with pytest.raises(InputError, match=r"a\.gplrec: A file with this name already exists"):
        RecordingWriter(tmp_path / "a.gplrec", RecordingHeader())
    assert (tmp_path / "a.gplrec").read_text() == "precious"


@pytest.mark.parametrize(
    ("rgb", "number", "time_s"),
    [
        (noisy(1, (24, 31)), 1, 0.1),
        (noisy(1, kind=np.uint16), 1, 0.1),
        (noisy(1)[..., :2], 1, 0.1),
        (noisy(1).astype(np.float32), 1, 0.1),
        (noisy(1), 0, 0.1),
        (noisy(1), 1, float("nan")),
    ],
    ids=["size", "depth", "channels", "kind", "number", "time"],
)
def test_a_frame_that_does_not_match_the_others_is_refused(tmp_path, rgb, number, time_s):
    with RecordingWriter(tmp_path / "a.gplrec", RecordingHeader()) as writer:
        writer.append(noisy(0), 0, 0.0)
        with pytest.raises(ValueError, match="frame"):
            writer.append(rgb, number, time_s)
    with Recording.open(tmp_path / "a.gplrec") as recording:
        assert len(recording) == 1
        assert not recording.truncated
