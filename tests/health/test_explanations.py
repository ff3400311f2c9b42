"""What changed in a frame is named by what explains it best, and corrected where it can be."""

from collections.abc import Callable

import cv2
import known_press
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.health.change_fit import SURE
from gelpolight_core.health.frame_health import LightGain
from gelpolight_core.health.health_check import HealthCheck
from gelpolight_core.health.row_light import RowLight, fit_rows
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import BallIndenter, CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign

Map = NDArray[np.float32]
MIXED = np.array([[1.05, -0.05, 0.0], [-0.02, 1.04, -0.02], [0.0, -0.06, 1.06]], np.float32)


@pytest.fixture(scope="module")
def known():
    """Return a sensor with its exact calibration."""
    return known_press.known_sensor(SensorDesign().scaled(0.5))


@pytest.fixture(scope="module")
def sensor(known):
    return Reconstructor(known.calibration)


@pytest.fixture(scope="module")
def frame(known):
    """Return a press in linear light, without noise."""
    return known_press.on(known, CylinderIndenter(5.0, 1.2), x_mm=3.0).frame


def by_row(share: Callable[[NDArray[np.float64]], NDArray[np.float64]], *channels: int):
    """Return a change of the light by the place 0..1 from top to bottom."""

    def change(frame: Map) -> Map:
        changed = frame.copy()
        factor = 1.0 + share(np.linspace(0.0, 1.0, len(frame)))
        for k in channels or (0, 1, 2):
            changed[..., k] *= factor[:, None]
        return changed

    return change


CORRECTED: dict[str, tuple[str, Callable[[Map], Map]]] = {
    "flicker": ("rows", by_row(lambda y: 0.03 * np.sin(17.0 * y + 1.0))),
    "flicker of one LED": ("rows", by_row(lambda y: 0.03 * np.sin(9.0 * y + 2.0), 0)),
    "pulses": ("rows", by_row(lambda y: 0.03 * np.sin(90.0 * y))),
    "exposure in mid frame": ("rows", by_row(lambda y: 0.03 * (y > 0.45))),
    "exposure in the last quarter": ("rows", by_row(lambda y: -0.03 * (y > 0.75))),
    "colour matrix": ("colour_mixing", lambda frame: frame @ MIXED.T),
}


@pytest.mark.parametrize("name", CORRECTED)
def test_what_changes_parts_of_a_frame_is_named_and_corrected(known, sensor, frame, name):
    key, change = CORRECTED[name]
    usual = sensor.depth(known.noisy(frame), normals=False)
    changed = known.noisy(change(frame))
    found = sensor.depth(changed, normals=False)
    assert key in found.health.keys
    assert not found.doubtful_findings
    deepest = usual.depth_mm > 0.8 * usual.depth_mm.max()
    off_mm = float((found.depth_mm - usual.depth_mm)[deepest].mean())
    assert abs(off_mm) < 0.01 * float(usual.depth_mm.max())


def test_a_zoom_beyond_what_the_fit_follows_is_a_movement(known, sensor, frame):
    rows, columns = frame.shape[:2]
    middle = 0.5 * (columns - 1), 0.5 * (rows - 1)
    zoom = cv2.getRotationMatrix2D(middle, 0.0, 1.02)
    zoomed = cv2.warpAffine(frame, zoom, (columns, rows), borderMode=cv2.BORDER_REPLICATE)
    health = sensor.health(known.noisy(zoomed))
    assert health.findings[0].key == "camera_moved"
    y, x = np.mgrid[:rows, :columns]
    largest_px = 0.02 * float(np.hypot(x - middle[0], y - middle[1]).max())
    assert 0.3 * largest_px < health.findings[0].value < largest_px


def test_a_curve_of_brightness_is_named_and_leaves_the_depth_doubtful(known, sensor, frame):
    bent = known.noisy(np.asarray(np.maximum(frame, 0.0) ** np.float32(1 / 1.1), np.float32))
    found = sensor.depth(bent, normals=False)
    assert found.health.faults[0].key == "tone"
    assert found.health.meaningless is None


def test_a_curve_changes_the_texture_within_a_cell_by_its_slope(known):
    """Room light adds the same light to dark and to bright specks: this tells the two apart."""
    check = HealthCheck(known.calibration.data)
    bare = np.clip(known.bare(), 1e-6, 1.0)
    _, of_curve = check.change(known.noisy(np.asarray(bare ** np.float32(0.97), np.float32)))
    _, of_room_light = check.change(known.noisy(bare + np.float32(0.01)))
    assert of_curve["tone"] > of_curve["room_light"] + SURE
    assert of_room_light["room_light"] > of_room_light["tone"] + SURE


def test_nothing_is_found_in_healthy_frames(known, sensor, frame):
    for shown in (known.bare(), frame):
        for light in (1.0, 0.98, 1.02):
            health = sensor.health(known.noisy(shown * np.float32(light)))
            assert set(health.keys) <= {"exposure"}
            assert not health.faults


def test_a_share_of_the_frame_before_is_found_in_the_shadows_and_corrected(known, sensor, frame):
    usual = sensor.depth(known.noisy(frame), normals=False)
    before = np.float32(0.08)
    blended = known.noisy((1 - before) * frame + before * known.bare())
    found = sensor.depth(blended, normals=False)
    assert "blended" not in [finding.key for finding in usual.findings]
    (finding,) = [finding for finding in found.findings if finding.key == "blended"]
    assert finding.value == pytest.approx(8.0, abs=1.5)
    assert float(found.depth_mm.max()) == pytest.approx(float(usual.depth_mm.max()), rel=0.02)


def test_without_shadows_the_light_that_no_surface_explains_shows_a_blended_frame(known, sensor):
    """The share is found in a ball, whose walls no LED leaves dark."""
    frame = known_press.on(known, BallIndenter(4.0, 0.6), x_mm=1.0).frame
    assert not sensor.depth(known.noisy(frame), normals=False).doubtful_findings
    before = np.float32(0.15)
    blended = known.noisy((1 - before) * frame + before * known.bare())
    keys = {f.key: f for f in sensor.depth(blended, normals=False).doubtful_findings}
    assert keys["low_contrast"].value == pytest.approx(15.0, abs=4.0)


def test_local_tone_mapping_changes_the_light_of_the_flat_membrane(known, sensor, frame):
    light = frame.mean(axis=2) + np.float32(1e-3)
    around = cv2.GaussianBlur(light, (0, 0), 0.05 * frame.shape[1])
    mapped = known.noisy(np.asarray(frame * ((light / around) ** 0.15)[..., None], np.float32))
    assert sensor.depth(mapped, normals=False).doubtful_findings[0].key == "flat_light"


def test_shadows_stay_dark_where_the_mixed_colour_is_less_than_black():
    gain = LightGain(np.ones(3), np.zeros(3), mixing=MIXED.astype(np.float64))
    light = np.array([[[0.0, 0.2, 0.3]]], np.float32)
    seen = np.maximum(light @ MIXED.T, 0.0)
    assert seen[0, 0, 0] == 0.0
    assert gain.evened(seen)[0, 0, 0] == 0.0


def test_light_by_row_is_that_of_the_rows():
    height, row = 480, np.repeat(np.arange(4.0, 480.0, 2.0), 3)
    random = np.random.default_rng(0)
    true = np.stack([0.02 * np.cos(4 * np.pi * (row + 0.5) / height), 0.0 * row, 0.0 * row], -1)
    seen = true + 0.002 * random.standard_normal(true.shape)
    weight = np.ones(row.size)
    found = fit_rows(row, seen, weight, height, sudden=False)
    assert found is not None
    assert np.abs(found.at(row) - true).max() < 5.0 * found.sd
    assert found.largest == pytest.approx(0.04, rel=0.05)
    assert fit_rows(row, seen - true, weight, height, sudden=False) is None


def test_a_change_of_the_light_is_undone_as_it_was_made():
    random = np.random.default_rng(1)
    light = random.uniform(0.1, 0.4, (60, 80, 3)).astype(np.float32)
    rows = RowLight(60, 20.0, np.array([2.0]), np.array([[0.03, 0.0, 0.01], [0.02] * 3]), 0.0)
    gain = LightGain(np.ones(3), np.zeros(3), rows=rows, mixing=MIXED.astype(np.float64))
    seen = (light * rows.over_image()) @ MIXED.T
    np.testing.assert_allclose(gain.evened(seen), light, atol=1e-6)
    assert not gain.is_even
