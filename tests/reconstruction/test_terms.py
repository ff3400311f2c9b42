"""Each term of a frame's reconstruction, left out: what it is there for then goes wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.measurement.score import DepthScore, read_true_depth, score_depth
from gelpolight_core.reconstruction.checks import free_boundary_note
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import Solved, Wanted
from gelpolight_core.reconstruction.terms import Terms
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image
from gelpolight_core.simulation.indenters import Cylinder
from gelpolight_core.simulation.indenters import press as pressed
from gelpolight_core.simulation.virtual_sensor import PressedMembrane, VirtualSensor

Map = NDArray[np.float32]
NAME = "cylinder_s4_d150"  # deep, with steep walls and shadows


@pytest.fixture(scope="module")
def rgb(small_session: Path) -> Map:
    return read_image(small_session / "presses" / f"{NAME}.png").rgb


@pytest.fixture(scope="module")
def whole(rgb: Map, small_calibration: Calibration) -> Solved:
    """Return the press with all terms on."""
    return solved(rgb, small_calibration)


def solved(rgb: Map, calibration: Calibration, **left_out: bool | int) -> Solved:
    wanted = Wanted(terms=Terms(**left_out))
    return NearLightSolver(calibration.data, workers=2).depth(rgb, wanted)


def scored(result: Solved, calibration: Calibration, session: Path) -> DepthScore:
    grid = calibration.table.grid
    truth = read_true_depth(session / "truth" / f"{NAME}.npz")
    return score_depth(result.depth_mm, grid.x_mm, grid.y_mm, truth, height_mm=1.5, radius_mm=12.0)


def test_all_terms_on_is_the_default_to_the_last_bit(
    rgb: Map, whole: Solved, small_calibration: Calibration
) -> None:
    default = Reconstructor(small_calibration).depth(rgb)
    for name in ("depth_mm", "normals", "flags"):
        np.testing.assert_array_equal(getattr(default, name), getattr(whole, name))


def test_light_frozen_at_the_flat_membrane_makes_the_press_too_high(
    rgb: Map, whole: Solved, small_calibration: Calibration, small_session: Path
) -> None:
    """PHYSICS: nearer light is brighter, by several percent of a depth of 1.5 mm."""
    frozen = solved(rgb, small_calibration, near_light_rounds=0)
    (rounds,) = (step.reason for step in frozen.trace.steps if "quarter scale" in step.name)
    assert "rounds: 0" in rounds
    error = scored(frozen, small_calibration, small_session).height_percent
    best = scored(whole, small_calibration, small_session).height_percent
    assert abs(error) > abs(best) + 1.0


def test_dark_channels_that_are_believed_are_not_flagged_and_cost_accuracy(
    rgb: Map, whole: Solved, small_calibration: Calibration, small_session: Path
) -> None:
    believed = solved(rgb, small_calibration, shadows=False)
    assert ((whole.flags & int(Flag.DARK)) != 0).sum() > 25
    assert not (believed.flags & int(Flag.DARK)).any()
    worse = scored(believed, small_calibration, small_session)
    assert worse.rms_um > scored(whole, small_calibration, small_session).rms_um


def test_a_rim_that_is_held_pulls_a_contact_that_crosses_it_down(
    small_calibration: Calibration,
) -> None:
    design = SensorDesign().scaled(0.25)
    surface = pressed(Cylinder(6.0, 0.8, 0.05), x_mm=-11.0, y_mm=3.0, decay_mm=0.7, pitch_mm=0.04)
    frame = VirtualSensor(design, 0).frame(PressedMembrane(surface), stream="rim")
    rgb = frame.astype(np.float32) / 255.0
    free = solved(rgb, small_calibration)
    held = solved(rgb, small_calibration, free_boundary=False)
    assert free_boundary_note() in free.findings
    assert free_boundary_note() not in held.findings
    grid = small_calibration.table.grid
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    top = (np.hypot(x + 11.0, y - 3.0) < 2.7) & (np.hypot(x, y) < 12.0)
    error = [abs(np.median(r.depth_mm[top]) - 0.8) for r in (free, held)]
    assert error[1] > 2.0 * error[0]
