"""The change of a sensor, as the trend keeps it: light, shift and blur that are known."""

import cv2
import numpy as np
import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.light.check import HealthCheck
from gelpolight_core.light.usual import usual_of_open
from gelpolight_core.studies.known_sensor import known_sensor


@pytest.fixture(scope="module")
def known():
    return known_sensor(SensorDesign().scaled(0.5))


@pytest.fixture(scope="module")
def check(known):
    data = known.calibration.data
    return HealthCheck(data, usual_of_open(), crosstalk=data.crosstalk)


def test_each_quantity_is_what_was_changed(known, check):
    bare = known.bare()
    moved = cv2.warpAffine(bare, np.float32([[1, 0, 0.3], [0, 1, -0.2]]), bare.shape[1::-1])
    cases = {
        "light": (bare * np.float32([0.99, 1.0, 1.02]), [-1.0, 0.0, 2.0, 0.0, 0.0, 0.0]),
        "shift": (moved, [0.0, 0.0, 0.0, 0.3, -0.2, None]),
        "blur": (cv2.GaussianBlur(bare, (0, 0), 1.0), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
    }
    # In percent, px and px**2. Shift and blur are linear for small changes only.
    allowed = np.array([0.05, 0.05, 0.05, 0.08, 0.08, 0.4])
    for name, (frame, true) in cases.items():
        change = check.check(known.noisy(frame)).change
        assert change is not None, name
        for k, expected in enumerate(true):
            if expected is not None:
                assert abs(change.values[k] - expected) < allowed[k], (name, k, change.values)


def test_its_deviation_is_that_of_repeated_frames(known, check):
    changes = [check.check(known.noisy(known.bare(), seed=seed)).change for seed in range(12)]
    seen = np.array([change.values for change in changes if change is not None])
    stated = np.mean([change.sd for change in changes if change is not None], axis=0)
    assert len(seen) == 12
    assert (seen.std(axis=0, ddof=1) < 2.0 * stated).all()
    assert (np.abs(seen.mean(axis=0)) < 3.0 * stated).all()
