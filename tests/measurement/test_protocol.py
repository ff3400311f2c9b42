"""The paper's protocol as a technician presses it: what, where, and left and gone on with."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.press import read_truth
from gelpolight_core.measurement.protocol import (
    ROOM_MM,
    Protocol,
    check_protocol,
    read_protocol_file,
)
from gelpolight_core.measurement.protocol_run import (
    begin_run,
    crossing_of,
    open_run,
    presses_folder,
)

SMALL = Protocol(shapes=("cylinder",), sizes_mm=(3.0,), heights_mm=(), repeats=2, regions=1)


def frames(value: int, count: int = 1) -> list[np.ndarray]:
    return [np.full((12, 16, 3), value, np.uint8) for _ in range(count)]


def test_the_whole_protocol_is_the_papers():
    presses = Protocol(reach_mm=11.5).presses()
    assert len(presses) == 2 * 9 * 30
    assert len({press.file for press in presses}) == len(presses)
    objects = {(p.truth.shape, p.truth.size_mm, p.truth.height_mm) for p in presses}
    assert {(s, h) for shape, s, h in objects if shape == "cuboid"} == {
        *((size, 1.0) for size in (3.0, 4.0, 5.0, 6.0, 7.0)),
        *((5.0, height) for height in (0.5, 0.75, 1.0, 1.25, 1.5)),
    }
    of_one = [p for p in presses if p.truth == presses[0].truth]
    assert [p.region for p in of_one[:5]] == ["same"] * 5
    assert len({p.position_mm for p in of_one[5:]}) == 25


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), reach=st.floats(8.0, 30.0))
def test_every_object_lies_within_reach_with_the_ground_around_it(seed, reach):
    for press in Protocol(seed=seed, reach_mm=reach, regions=3).presses():
        half = 0.5 * press.truth.size_mm
        corner = half * math.sqrt(2.0) if press.truth.shape == "cuboid" else half
        # Places are rounded to hundredths of a millimetre.
        assert math.hypot(*press.position_mm) + corner + ROOM_MM <= reach + 0.01


@pytest.mark.parametrize(
    ("protocol", "message"),
    [
        (Protocol(shapes=("ball",)), "no shape 'ball'"),
        (Protocol(sizes_mm=(), heights_mm=()), "the protocol contains no object"),
        (Protocol(sizes_mm=(0.0,)), "sizes_mm contains 0"),
        (Protocol(heights_mm=(math.nan,)), "heights_mm contains nan"),
        (Protocol(sizes_mm=(3.0, 3.001)), "sizes_mm contains a length twice"),
        (Protocol(shapes=("cuboid", "cuboid")), "a shape is named twice"),
        (Protocol(repeats=0, regions=0), "the protocol contains no press"),
        (Protocol(regions=100), "number of regions is 100"),
        (Protocol(reach_mm=6.0), "a cuboid of 6 mm does not fit within 6.0 mm"),
    ],
)
def test_a_protocol_that_nobody_can_press_is_refused(protocol, message):
    with pytest.raises(InputError, match=message):
        check_protocol(protocol)


def test_a_run_is_left_and_gone_on_with_where_it_was(tmp_path):
    run = begin_run(tmp_path / "run", SMALL, serial="A-1", calibration="A-1-abc")
    first = run.next()
    assert first is not None
    run.accept(first, frames(10, 4))
    run.refuse(first, "It moved, and was held anew.")

    again = open_run(tmp_path / "run")
    assert again.content == run.content
    assert again.wanted == run.wanted
    assert again.done == (first,)
    assert again.next() == run.next() == run.wanted[1]
    progress = again.progress
    assert (progress.done, progress.total, progress.refused) == (1, 3, 1)
    assert (progress.object_done, progress.object_total) == (1, 3)
    for press in again.left:
        again.accept(press, frames(20))
    assert again.next() is None
    assert again.progress.share == 1.0


def test_the_run_is_the_folder_that_evaluate_reads(tmp_path):
    run = begin_run(tmp_path / "run", SMALL, serial="A-1", calibration="A-1-abc")
    for press in reversed(run.wanted):
        run.accept(press, frames(10))
    folder = presses_folder(tmp_path / "run")
    assert folder == tmp_path / "run" / "presses"
    rows = read_truth(folder).rows
    assert [row.file for row in rows] == [press.file for press in run.wanted]
    assert [row.truth for row in rows] == [press.truth for press in run.wanted]
    assert [row.region for row in rows] == ["same", "same", "r01"]
    assert crossing_of(folder) == SMALL.crossing
    assert presses_folder(folder) == folder
    assert crossing_of(tmp_path) is None


def test_a_press_taken_back_is_asked_for_again_and_its_image_is_kept(tmp_path):
    run = begin_run(tmp_path / "run", SMALL, serial="A-1", calibration="A-1-abc")
    press = run.wanted[0]
    for value in (10, 20):
        run.accept(press, frames(value))
        kept = run.take_back(press)
        assert kept is not None
        assert cv2.imread(str(kept)).mean() == value
    assert run.next() == press
    assert open_run(run.folder).next() == press
    assert len(list((run.folder / "discarded").iterdir())) == 2
    with pytest.raises(InputError, match="not done yet"):
        run.take_back(press)


def test_an_image_that_was_taken_away_is_asked_for_again(tmp_path):
    run = begin_run(tmp_path / "run", SMALL, serial="A-1", calibration="A-1-abc")
    for press in run.wanted:
        run.accept(press, frames(10))
    run.image(run.wanted[1]).unlink()
    again = open_run(run.folder)
    assert again.left == (run.wanted[1],)


@pytest.mark.parametrize(
    ("key", "other", "message"),
    [
        ("repeats = 2", 'repeats = "two"', "repeats has the invalid value two"),
        ("seed = 0", "seed = -1", "seed is below zero"),
        ("seed = 0", "seed = 0\nsneed = 1", "unknown entry sneed"),
        ("3.0,", '"wide",', "sizes_mm.0 has the invalid value wide"),
        ("at_size_mm = 5.0", "", "at_size_mm is missing"),
    ],
)
def test_a_mistake_in_the_protocol_is_named(tmp_path, key, other, message):
    run = begin_run(tmp_path / "run", SMALL, serial="A-1", calibration="A-1-abc")
    path = run.folder / "protocol.toml"
    text = path.read_text()
    assert key in text
    path.write_text(text.replace(key, other))
    with pytest.raises(InputError, match=message):
        read_protocol_file(run.folder)
