"""The background's own light under a near LED, where the image of it is saturated."""

from dataclasses import replace

import known_press
import numpy as np
import pytest

from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.calibration.saturated_background import fill_saturated_background
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.studies.exact_sensor import matt_design


@pytest.fixture(scope="module")
def calibration():
    return known_press.known_sensor(matt_design(0.25)).calibration


def clipped(calibration: Calibration, *, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the true background, brighter so that a part exceeds 1, and what a camera shows."""
    true = calibration.data.full.background * np.float32(
        top / calibration.data.full.background.max()
    )
    raw = true @ calibration.data.crosstalk.T.astype(np.float32)
    shown = np.minimum(raw, np.float32(1.0))
    return true, shown


def test_light_beyond_saturation_is_found_from_what_is_around(calibration):
    true, shown = clipped(calibration, top=1.1)
    lost = (shown >= SATURATED).any(axis=-1) & calibration.table.valid
    assert lost.sum() > 20
    assert calibration.data.full is not None
    unmixed = shown @ np.linalg.inv(calibration.data.crosstalk).T.astype(np.float32)
    full = replace(calibration.data.full, background=unmixed)
    unknown = np.where(lost[..., None], np.float32(0.0), calibration.data.factors)
    light, factors = fill_saturated_background(
        full, shown, unknown, calibration.data.crosstalk, calibration.table
    )
    assert np.percentile(np.abs(light[lost] / true[lost] - 1.0), 95.0) < 0.02
    assert np.abs(unmixed[lost] / true[lost] - 1.0).max() > 0.05
    np.testing.assert_array_equal(light[~lost], unmixed[~lost])
    known = lost & (calibration.data.factors > 0.0).all(axis=-1)
    off = np.abs(factors[known] / calibration.data.factors[known] - 1.0)
    assert np.percentile(off, 95.0) < 0.05
    np.testing.assert_array_equal(factors[~lost], unknown[~lost])
