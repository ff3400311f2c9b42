"""A user looks whether the sensor has drifted, and sets it to zero before work."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.reconstruction.background_shift import background_shift, with_zero
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.simulation.exposure import exposed
from gelpolight_core.simulation.lamps import lamps_of
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.virtual_sensor import BareMembrane, VirtualSensor

BRIGHTER = (1.03, 1.0, 0.97)
# More than is corrected in an image.
MUCH_BRIGHTER = (1.13, 1.0, 0.87)


def frames(*shares: float, count: int = 4) -> list[PixelArray]:
    """Return frames of the untouched virtual sensor, its LEDs changed by shares."""
    design = SensorDesign().scaled(0.25)
    sensor = VirtualSensor(design, 0)
    changed = tuple(
        replace(lamp, power=lamp.power * share)
        for lamp, share in zip(lamps_of(design), shares, strict=True)
    )
    warm = VirtualSensor(design, 0, lamps=changed)
    # The camera's exposure stays; a new sensor would be exposed again.
    image = warm.brightness(BareMembrane()) * sensor.exposure / warm.exposure
    random = np.random.default_rng(5)
    return [exposed(image, design.camera, random) for _ in range(count)]


@pytest.fixture(scope="module")
def warm():
    """Return frames after the red LED has grown 3 % brighter and the blue one darker."""
    return frames(*BRIGHTER)


def moved(frame: NDArray[np.float32], columns: int) -> NDArray[np.float32]:
    """Return a frame that the camera sees further to the right."""
    return np.ascontiguousarray(np.roll(frame, columns, axis=1))


def test_a_sensor_that_has_not_changed_has_not_drifted(small_calibration):
    shift = background_shift(frames(1.0, 1.0, 1.0, count=1)[0], small_calibration)
    assert not shift.touched
    assert np.abs(shift.brightness_percent).max() < 0.5
    assert shift.differs_percent < 1.0
    assert shift.shift_px is None or np.hypot(*shift.shift_px) < 0.2
    assert shift.quality.verdict is Verdict.PASS


def test_leds_that_changed_are_reported_by_channel(small_calibration, warm):
    shift = background_shift(warm[0], small_calibration)
    assert shift.brightness_percent == pytest.approx([3.0, 0.0, -3.0], abs=0.5)
    assert not shift.touched
    assert shift.quality.verdict is Verdict.WARN
    assert any("zero" in line for line in shift.quality.remedies)


def test_a_membrane_that_moved_in_the_image_is_reported(small_calibration, small_session):
    bare = read_linear_image(next((small_session / "background").iterdir())).rgb
    shift = background_shift(moved(bare, 2), small_calibration)
    assert shift.shift_px == pytest.approx((2.0, 0.0), abs=0.3)
    assert shift.quality["drift_shift_px"].verdict is Verdict.FAIL
    with pytest.raises(InputError, match="the membrane has moved by"):
        with_zero(small_calibration, [moved(bare, 2)], operator="me", made="now")


def test_a_press_is_called_a_touch_and_never_taken_for_the_background(
    small_calibration, small_session
):
    press = read_linear_image(small_session / "presses" / "cylinder_s5_d050.png").rgb
    shift = background_shift(press, small_calibration)
    assert shift.touched
    assert shift.quality.verdict is Verdict.FAIL
    with pytest.raises(InputError, match="something is pressed"):
        with_zero(small_calibration, [press], operator="me", made="now")


@pytest.mark.parametrize("model", ["paper", "full"])
def test_after_zeroing_changed_leds_the_bare_membrane_is_flat(small_calibration, model):
    warm = frames(*MUCH_BRIGHTER)
    new = with_zero(small_calibration, warm[1:], operator="me", made="2026-01-02T03:04:05+00:00")
    before, after = (
        Reconstructor(c, model=model).depth(warm[0]).depth_mm for c in (small_calibration, new)
    )
    assert np.sqrt(np.mean(after**2)) <= max(0.25 * np.sqrt(np.mean(before**2)), 1e-3)
    shift = background_shift(warm[0], new)
    assert np.abs(shift.brightness_percent).max() < 0.3


def test_a_place_too_dim_for_the_calibration_stays_out_after_zeroing(small_calibration, warm):
    dim = small_calibration.data.radiance.copy()
    rows, columns = (slice(n // 2, n // 2 + 5) for n in dim.shape[:2])
    dim[rows, columns, 1] *= 0.005 / dim[rows, columns, 1].max()
    factors = small_calibration.data.factors.copy()
    factors[rows, columns] = 0.0
    dull = small_calibration.changed(radiance=dim, factors=factors)
    new = with_zero(dull, warm[1:], operator="me", made="2026-01-02T03:04:05+00:00")
    assert not new.data.factors[rows, columns].any()
    assert new.data.factors.any(axis=2).mean() > 0.9 * factors.any(axis=2).mean()


def test_zeroing_is_on_record_and_has_a_name_of_its_own(small_calibration, warm, tmp_path):
    new = with_zero(small_calibration, warm, operator="me", made="2026-01-02T03:04:05+00:00")
    assert new.identity != small_calibration.identity
    edit = new.provenance.edits[-1]
    assert (edit.part, edit.operator) == ("background", "me")
    write_calibration(new, tmp_path / "zero.gplcal")
    again = read_calibration(tmp_path / "zero.gplcal")
    assert again.identity == new.identity
    assert again.provenance.edits == new.provenance.edits


def test_what_is_no_image_of_this_sensor_is_refused(small_calibration):
    camera = small_calibration.camera
    dark = np.zeros((camera.height, camera.width, 3), np.float32)
    with pytest.raises(InputError, match="dark"):
        background_shift(dark, small_calibration)
    with pytest.raises(InputError, match="the calibration is for"):
        background_shift(dark[1:], small_calibration)
    with pytest.raises(InputError, match="no image"):
        with_zero(small_calibration, [], operator="me", made="now")
