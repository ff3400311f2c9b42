"""The full model as its user meets it: presses of the virtual sensor against their truth."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import Solved, Wanted
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image
from gelpolight_core.simulation.virtual_sensor import BareMembrane, VirtualSensor

Map = NDArray[np.float32]
# Cylinders and blocks of 1 mm; the block of 6 mm has a test of its own.
PRESSES = ("cylinder_s5_d100", "cuboid_s4_d100")
WIDE = "cuboid_s6_d100"


class Score:
    """What a depth map shows of a press beside its truth."""

    def __init__(self, heightmap: HeightMap, truth: Path, radius_mm: float) -> None:
        with np.load(truth) as data:
            expected = data["depth_mm"].astype(float)
            pitch, x0, y0 = (float(data[k]) for k in ("pitch_mm", "x0_mm", "y0_mm"))
        x, y = np.meshgrid(
            x0 + pitch * np.arange(expected.shape[1]), y0 + pitch * np.arange(expected.shape[0])
        )
        column = (x - heightmap.x_mm[0]) / heightmap.pitch_mm
        row = (y - heightmap.y_mm[0]) / heightmap.pitch_mm
        found = cv2.remap(
            heightmap.depth_mm, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR
        )
        inside = np.hypot(x, y) < radius_mm
        height = expected[inside].max()
        top = inside & (expected > 0.98 * height)
        self.height = float(np.median(found[top]) / np.median(expected[top]) - 1.0)
        area = [float(((d > height / 2) & inside).sum()) for d in (found, expected)]
        self.size = float(np.sqrt(area[0] / area[1]) - 1.0)
        self.rms_mm = float(np.sqrt(np.mean((found - expected)[inside] ** 2)))


@pytest.fixture(scope="module")
def score(virtual_session: Path, virtual_calibration: Calibration):  # type: ignore[no-untyped-def]
    """Return a function that reconstructs a press once and scores it."""

    @cache
    def scored(name: str, model: str) -> Score:
        frame = read_image(virtual_session / "presses" / f"{name}.png").rgb
        heightmap = Reconstructor(virtual_calibration, model=model).depth(frame)
        return Score(heightmap, virtual_session / "truth" / f"{name}.npz", 11.0)

    return scored


def press(session: Path, name: str = PRESSES[0]) -> Map:
    return read_image(session / "presses" / f"{name}.png").rgb


def solve(rgb: Map, calibration: Calibration, *, workers: int = 2) -> Solved:
    """Solve the whole grid at full scale."""
    return NearLightSolver(calibration.data, workers=workers).depth(rgb, Wanted(everywhere=True))


@pytest.mark.parametrize("name", PRESSES)
def test_a_plateau_has_its_height(score, name: str) -> None:  # type: ignore[no-untyped-def]
    """Half of what the paper's 3 % leaves."""
    assert abs(score(name, "full").height) < 0.015


def test_a_wide_plateau_has_its_height(score) -> None:  # type: ignore[no-untyped-def]
    """Wide walls add up: 1.8 % low was measured, 1 % of it for each 0.01 of gloss."""
    assert abs(score(WIDE, "full").height) < 0.025


@pytest.mark.parametrize("name", [*PRESSES, WIDE])
def test_an_outline_has_its_size_at_half_height(score, name: str) -> None:  # type: ignore[no-untyped-def]
    """A pixel of half the image's size is 1 % of 5 mm."""
    assert abs(score(name, "full").size) < 0.015


@pytest.mark.parametrize("name", [*PRESSES, WIDE])
def test_the_full_model_is_nearer_to_the_truth_than_the_papers(score, name: str) -> None:  # type: ignore[no-untyped-def]
    assert score(name, "full").rms_mm < 0.7 * score(name, "paper").rms_mm


def test_an_image_of_the_bare_membrane_is_flat(virtual_calibration: Calibration) -> None:
    """Another frame than the calibration's, with its own noise."""
    sensor = VirtualSensor(SensorDesign().scaled(0.5), 0)
    frame = sensor.frame(BareMembrane(), averaged=1, stream="another")
    heightmap = Reconstructor(virtual_calibration).depth(frame)
    inside = np.hypot(heightmap.x_mm[None, :], heightmap.y_mm[:, None]) < 11.0
    # 8-bit noise of 50 dB: slopes of about 0.01 that average out over a node or two of 0.05 mm.
    assert np.sqrt(np.mean(heightmap.depth_mm[inside] ** 2)) < 3e-3
    assert np.abs(heightmap.depth_mm[inside]).max() < 10e-3


def test_the_refined_leds_are_nearer_to_the_truth_than_the_mirrors(
    virtual_session: Path, virtual_calibration: Calibration
) -> None:
    """The housing states one height; the LEDs scatter about it by up to 0.2 mm."""
    full = virtual_calibration.data.full
    assert full is not None
    leds = np.array([[led.x_mm, led.y_mm, -led.height_mm] for led in SensorDesign().leds])
    refined = np.linalg.norm(full.led_positions_mm - leds, axis=1)
    mirror = np.linalg.norm(virtual_calibration.data.led_positions_mm - leds, axis=1)
    assert refined.mean() < mirror.mean()
    assert (refined < 0.12).all()
    truth = json.loads((virtual_session / "truth.json").read_text())
    assert full.decay_mm == pytest.approx(truth["membrane"]["decay_length_mm"], rel=0.05)
    assert full.held_out[1] <= full.held_out[0] or full.kept == "mirror"


def test_normals_belong_to_the_depth(
    virtual_session: Path, virtual_calibration: Calibration
) -> None:
    heightmap = Reconstructor(virtual_calibration).depth(press(virtual_session))
    assert heightmap.model == "full"
    assert heightmap.normals is not None
    np.testing.assert_allclose(np.linalg.norm(heightmap.normals, axis=-1), 1.0, atol=1e-5)
    assert (heightmap.normals[..., 2] < 0.0).all()
    slope_y, slope_x = np.gradient(heightmap.depth_mm, heightmap.pitch_mm)
    found = heightmap.normals[..., :2] / heightmap.normals[..., 2:]
    # On the gentle part; at the walls a central difference and a node's normal differ.
    gentle = (np.hypot(slope_x, slope_y) < 0.5) & (heightmap.flags == 0) & (np.abs(slope_x) > 0.05)
    gentle[:, :20] = gentle[:, -20:] = False
    assert gentle.sum() > 500
    assert np.median(np.abs(found[..., 0] - slope_x)[gentle]) < 0.02
    gentle &= np.abs(slope_y) > 0.05
    assert np.median(np.abs(found[..., 1] - slope_y)[gentle]) < 0.02


def test_threads_do_not_change_the_depth(
    virtual_session: Path, virtual_calibration: Calibration
) -> None:
    rgb = press(virtual_session)
    one, two = (solve(rgb, virtual_calibration, workers=n) for n in (1, 2))
    np.testing.assert_array_equal(one.depth_mm, two.depth_mm)
    np.testing.assert_array_equal(one.flags, two.flags)


@pytest.mark.parametrize(
    "value",
    [
        np.nan,
        np.inf,
        0.0,
        1.0,
    ],
)
def test_a_spoilt_pixel_on_the_ground_leaves_the_plateau_alone(
    virtual_session: Path, virtual_calibration: Calibration, value: float
) -> None:
    rgb = press(virtual_session)
    before = solve(rgb, virtual_calibration)
    spoilt = rgb.copy()
    spoilt[230:233, 120:123] = value  # left of the press, on flat ground
    after = solve(spoilt, virtual_calibration)
    assert np.isfinite(after.depth_mm).all()
    assert np.isfinite(after.normals).all()
    top = before.depth_mm > 0.95
    assert top.sum() > 1000
    assert np.abs(after.depth_mm - before.depth_mm)[top].max() < 3e-3
    changed = (after.flags != before.flags).sum()
    assert 1 <= changed < 100
