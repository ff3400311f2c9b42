"""Wrong scales and ball diameters are found, as far as they can be known."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.closed_sensor.plausibility import preset_of
from gelpolight_core.calibration.closed_sensor.preset import stated_sizes
from gelpolight_core.calibration.closed_sensor_recipe import BALLS
from gelpolight_core.calibration.closed_sensor_stages import SlopesStageResult, find_slopes
from gelpolight_core.sensor.closed_sensor.working_grid import ImageSize, WorkingGrid
from gelpolight_core.session.session import Session, read_session
from tests.calibration.closed_sensor.conftest import few

Array = NDArray[np.float32]
FACTORS = st.floats(-1.0, 1.0).map(lambda power: 10.0**power)


def with_sizes(session: Session, scale: float, radius: float) -> Session:
    """Return a session of five presses with another scale and other radii, by factors."""
    stated = session.in_place
    assert stated is not None and stated.mm_per_px is not None
    x, y = stated.mm_per_px
    names = [path.name for path in session.files("balls")]
    return replace(
        few(session),
        in_place=replace(stated, mm_per_px=(scale * x, scale * y)),
        ball_radii_mm={name: radius * session.ball_radius_mm(name) for name in names},
    )


def slopes_with(session: Session, scale: float = 1.0, radius: float = 1.0) -> SlopesStageResult:
    """Return what such a session gives."""
    changed = with_sizes(session, scale, radius)
    return find_slopes(changed, changed.averaged("background"))


@pytest.mark.long
@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(scale=FACTORS, radius=FACTORS)
def test_every_scale_and_radius_gives_a_result_or_a_refusal(closed_session, scale, radius):
    try:
        found = slopes_with(closed_session, scale, radius)
    except InputError as refusal:
        assert refusal.advice
    else:
        assert len(found.result.presses) >= 3


@pytest.mark.function("Learn that scale or ball diameters of a closed sensor are wrong")
@pytest.mark.parametrize(("scale", "radius"), [(10.0, 1.0), (1.0, 10.0)])
def test_ten_times_too_much_fails_and_names_scale_and_balls(closed_session, scale, radius):
    try:
        quality = slopes_with(closed_session, scale, radius).quality
    except InputError as refusal:
        assert refusal.advice == Remedy.CHECK_SIZES.format()
    else:
        assert quality.verdict is Verdict.FAIL
        assert any(Remedy.CHECK_SIZES.format() in remedy for remedy in quality.remedies)


def test_a_radius_that_is_the_diameter_is_doubted_and_the_right_one_is_not(
    closed_session, closed_run
):
    doubled = slopes_with(closed_session, 1.0, 2.0).quality
    right = closed_run.results[BALLS].quality
    assert doubled["ball_size_factor"].value / right["ball_size_factor"].value > 1.7
    for key in ("ball_size_factor", "contact_over_ball", "ball_sizes_percent"):
        assert right[key].verdict is Verdict.PASS


@pytest.mark.function("Learn which of several balls has a wrong diameter")
def test_one_wrong_size_among_several_is_named(closed_session):
    radii = {
        path.name: closed_session.ball_radius_mm(path.name)
        for path in closed_session.files("balls")
    }
    largest = max(radii.values())
    wrong = {name: 2.0 * r if r == largest else r for name, r in radii.items()}
    changed = replace(closed_session, ball_radii_mm=wrong)
    found = find_slopes(changed, changed.averaged("background"))
    named = {name for name, fault in found.result.refused.items()}
    assert named == {name for name, r in radii.items() if r == largest} or (
        found.quality["ball_sizes_percent"].verdict is not Verdict.PASS
    )


def test_the_stated_sizes_are_shown_to_be_confirmed():
    grid = WorkingGrid(ImageSize(320, 240), 0.0634)
    assert preset_of(grid) is not None
    assert preset_of(replace(grid, mm_per_px=0.00634)) is None
    sentence = stated_sizes([12.7, 9.5, 12.7], (0.0634, 0.0634), (320, 240))
    for number in ("19", "25.4", "0.0634", "20.3", "15.2"):
        assert number in sentence


def other_images(folder: Path, out: Path, change: Callable[[Array, bool], Array]) -> Session:
    """Return a session whose images are changed by a function, which gets True for a press."""
    shutil.copytree(folder, out)
    for path in sorted(out.glob("b*/*.png")):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        most = np.iinfo(image.dtype).max
        changed = change(image.astype(np.float32), path.parent.name == "balls")
        assert cv2.imwrite(str(path), np.clip(changed, 0, most).round().astype(image.dtype))
    return read_session(out)


@pytest.mark.function("Calibrate a gel whose texture moves with the press")
def test_a_texture_that_the_press_drags_is_calibrated(closed_folder, tmp_path):
    def textured(image: Array, pressed: bool) -> Array:
        # The same texture in every image.
        texture = np.random.default_rng(3).normal(0.0, 1.0, image.shape[:2]).astype(np.float32)
        texture = cv2.GaussianBlur(texture, (0, 0), 2.0)
        texture = 1.0 + 0.03 * texture / texture.std()
        dragged = np.roll(texture, (2, 2), (0, 1)) if pressed else texture
        return np.asarray(image * dragged[..., None], np.float32)

    quality = slopes_with(other_images(closed_folder, tmp_path / "dragged", textured)).quality
    assert quality["balls_left_out_percent"].value == 0.0
    assert quality["held_out_normal_deg"].verdict is Verdict.PASS


@pytest.mark.function("Calibrate with a background under other light")
def test_a_background_under_other_light_is_corrected(closed_folder, tmp_path):
    def dimmed(image: Array, pressed: bool) -> Array:
        return image if pressed else np.asarray(0.94 * image, np.float32)

    quality = slopes_with(other_images(closed_folder, tmp_path / "dimmed", dimmed)).quality
    assert quality["balls_left_out_percent"].value == 0.0
    assert quality["held_out_normal_deg"].verdict is Verdict.PASS
