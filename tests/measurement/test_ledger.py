"""What was measured is not measured again, and nothing old is taken for new."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reference import Truth
from tests.measurement.maps import measurement


def measured(height: float = 1.0 / 3.0) -> Measurement:
    spread = {"side_mm": (0.1 / 3, 0.01), "height_mm": 1e-3 / 7, "yaw_deg": None}
    outline = np.random.default_rng(0).standard_normal((5, 2))
    found = replace(measurement("cuboid", 4.0 / 3.0, height), outline_mm=outline, blur_mm=None)
    return replace(found, sd=spread, calibration_sd=spread, side_mm=(4.0 / 3.0, 5.0 / 7.0))


def same(a: Measurement, b: Measurement) -> bool:
    """Return whether all fields are equal to the last bit."""
    return all(
        np.array_equal(x, y) if isinstance(x, np.ndarray) else x == y
        for x, y in ((getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    )


@pytest.fixture
def image(tmp_path):
    path = tmp_path / "press.png"
    path.write_bytes(b"picture")
    return path


@settings(max_examples=25, deadline=None)
@given(height=st.floats(allow_nan=False, allow_infinity=False))
def test_a_measurement_comes_back_to_the_last_bit(tmp_path_factory, height):
    path = tmp_path_factory.mktemp("ledger") / "m.jsonl"
    ledger = Ledger(path, "calibration full")
    ledger.keep("a", measured(height))
    ledger.keep("b", "no object is pressed")
    again = Ledger(path, "calibration full")
    found = again.find("a")
    assert isinstance(found, Measurement)
    assert same(found, measured(height))
    assert again.find("b") == "no object is pressed"
    assert again.find("c") is None


def test_another_image_shape_or_calibration_is_measured_anew(tmp_path, image):
    ledger = Ledger(tmp_path / "m.jsonl", "one")
    pressed = Truth("cylinder", 5.0, height_mm=1.0)
    edged = replace(pressed, edge_radius_mm=0.3)
    keys = {
        ledger.key(image, truth) for truth in (pressed, edged, Truth("cuboid", 5.0, height_mm=1.0))
    }
    keys.add(Ledger(tmp_path / "m.jsonl", "other").key(image, pressed))
    image.write_bytes(b"taken again")
    keys.add(ledger.key(image, pressed))
    assert len(keys) == 5
    assert ledger.key(tmp_path / "missing.png", pressed) is None


@pytest.mark.parametrize("cut", [1, 40, 400])
def test_a_line_cut_short_by_a_crash_costs_that_line_only(tmp_path, cut):
    path = tmp_path / "m.jsonl"
    ledger = Ledger(path, "n")
    ledger.keep("a", measured())
    ledger.keep("b", measured())
    path.write_bytes(path.read_bytes()[:-cut])
    torn = Ledger(path, "n")
    assert torn.find("b") is None or cut == 1
    torn.keep("c", replace(measured(), height_mm=math.pi))
    whole = Ledger(path, "n")
    found = whole.find("c")
    assert isinstance(whole.find("a"), Measurement)
    assert isinstance(found, Measurement) and found.height_mm == math.pi
