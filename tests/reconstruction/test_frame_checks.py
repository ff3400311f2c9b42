"""What a reconstruction takes, refuses, and says of images that cannot be right."""

from dataclasses import replace

import known_press
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from gelpolight_core.base.errors import InputError
from gelpolight_core.image.bad_pixels import BadPixels
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import BallIndenter
from gelpolight_core.studies.exact_sensor import matt_design
from gelpolight_core.studies.image_case_helpers import standard_press, standard_sensor

TINY = known_press.known_sensor(matt_design(0.06))
HEIGHT, WIDTH = TINY.calibration.camera.height, TINY.calibration.camera.width
STANDARD = [
    Reconstructor(standard_sensor().calibration, model=model) for model in ("full", "paper")
]
RECONSTRUCTORS = [
    Reconstructor(TINY.calibration, model="paper"),
    *(Reconstructor(TINY.calibration, model="full", effort=effort) for effort in EFFORTS),
]
KINDS = st.one_of(
    npst.unsigned_integer_dtypes(sizes=(8, 16, 32)),
    npst.integer_dtypes(sizes=(8, 16)),
    npst.floating_dtypes(),
    npst.boolean_dtypes(),
    npst.complex_number_dtypes(),
)
SHAPES = st.one_of(
    st.just((HEIGHT, WIDTH, 3)),
    st.just((HEIGHT, WIDTH, 3)),
    npst.array_shapes(min_dims=1, max_dims=4, min_side=0, max_side=5),
    st.sampled_from([(HEIGHT, WIDTH), (WIDTH, HEIGHT, 3), (HEIGHT, WIDTH, 4), (1, WIDTH, 3)]),
)


@st.composite
def images(draw: st.DrawFn) -> np.ndarray:
    """Return any array: mostly one value all over, with a few others, whatever they are."""
    kind, shape = draw(KINDS), draw(SHAPES)
    values = npst.from_dtype(np.dtype(kind))
    image = np.full(shape, draw(values), kind)
    if image.size:
        for value in draw(st.lists(values, max_size=6)):
            image.flat[draw(st.integers(0, image.size - 1)) :: 7] = value
    return image


@settings(max_examples=30, deadline=None)
@given(images())
def test_no_image_whatever_crashes_or_gives_depth_that_is_no_number(image):
    for reconstruct in RECONSTRUCTORS:
        try:
            found = reconstruct.depth(image)
        except InputError as refusal:
            assert refusal.advice
            continue
        assert np.isfinite(found.depth_mm).all()
        assert found.normals is not None and np.isfinite(found.normals).all()


@settings(max_examples=4, deadline=None)
@given(
    st.sampled_from([np.nan, np.inf, -np.inf, -1.0, 3e38, 1e-45, 0.0, 1.0]),
    st.integers(0, 2**32 - 1),
)
def test_a_few_wild_pixels_leave_the_rest_of_the_map_as_it_was(value, seed):
    press = standard_press()
    frame = press.frame.copy()
    rows, columns = np.random.default_rng(seed).integers(30, 200, (2, 10))
    frame[rows, columns] = value
    found, clean = (STANDARD[0].depth(f).depth_mm for f in (frame, press.frame))
    assert np.sqrt(np.mean((found - clean) ** 2)) < 0.005


@pytest.mark.parametrize("reconstruct", STANDARD, ids=lambda r: r.model)
def test_another_exposure_or_colour_order_than_the_calibrations_is_reported(reconstruct):
    frame = standard_press().frame
    assert not reconstruct.depth(frame).findings
    for share in (0.9, 0.5):
        darker = reconstruct.depth(frame * np.float32(share))
        assert darker.health is not None and darker.health.keys == ("exposure",)
        assert not darker.doubtful_findings
    for wrong, key in ((frame[..., ::-1], "colour_order"), (frame[::-1], "other_sensor")):
        found = reconstruct.depth(wrong)
        assert found.health.meaningless.key == key
        assert found.health.findings[0] in found.findings


def test_light_that_has_drifted_by_two_per_cent_is_reported_with_its_amount():
    frame = standard_press().frame
    red = frame * np.array([1.02, 1.0, 1.0], np.float32)
    for reconstruct in STANDARD:
        health = reconstruct.depth(red).health
        assert health is not None and health.keys == ("led_weak",)
        assert health.findings[0].value == pytest.approx(2.0, abs=0.1)
        eight_bit = np.rint(frame * 255.0 * 1.0005).astype(np.uint8)
        assert not reconstruct.depth(eight_bit).findings


def test_known_bad_pixels_are_left_out_of_the_solve():
    frame = np.rint(standard_press().frame * 255.0).astype(np.uint8)
    calibration, (height, width) = standard_sensor().calibration, frame.shape[:2]
    bad = np.random.default_rng(0).random((height, width)) < 1e-3
    bad[:, 150] = True
    spoilt = frame.copy()
    spoilt[bad] = 255
    places = np.argwhere(bad).astype(np.int32)
    known = calibration.changed(bad=BadPixels(places, height, width))
    for effort in EFFORTS:
        reconstruct = Reconstructor(calibration, effort=effort)
        good = reconstruct.depth(frame)
        seen = reconstruct.depth(spoilt)
        mended = Reconstructor(known, effort=effort).depth(spoilt)
        worst = float(np.abs(mended.depth_mm - good.depth_mm).max())
        assert worst < 0.01
        assert not mended.findings
        assert seen.doubtful_findings
        assert seen.health is not None and "bad_line" in seen.health.keys


def test_a_contact_on_the_rim_is_not_taken_for_another_sensor():
    press = standard_sensor().pressed(BallIndenter(4.0, 1.0), x_mm=11.0, samples=1)
    notes = STANDARD[0].depth(press.frame).findings
    assert notes and not any(note.key == "exposure" for note in notes)


def test_lights_in_one_plane_are_refused_with_their_condition():
    calibration = standard_sensor().calibration
    row = np.array([[-8.0, 0.1, -13.7], [0.0, 0.0, -13.7], [8.0, 0.0, -13.7]])
    assert calibration.data.full is not None
    flat = calibration.changed(full=replace(calibration.data.full, led_positions_mm=row))
    with pytest.raises(InputError, match="condition"):
        Reconstructor(flat)
