"""What the solver leaves out at each effort, and that it changes no more than is stated."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import Wanted
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image
from gelpolight_core.simulation.indenters import Ball, Cylinder
from gelpolight_core.simulation.indenters import press as pressed
from gelpolight_core.simulation.virtual_sensor import (
    BareMembrane,
    PressedMembrane,
    State,
    VirtualSensor,
)

Frame = NDArray[np.uint8]
PRESS = "cylinder_s5_d100"
# What a region of the contact may change: drape below half a degree, and depth 0 at its border.
REGION_MM = 8e-3


def as_camera(rgb: NDArray[np.float32]) -> Frame:
    return np.asarray(np.round(rgb * 255.0), np.uint8)


@pytest.fixture(scope="module")
def shown() -> Callable[[State], Frame]:
    """Return a function that shows a state of the virtual sensor at half its size."""
    sensor = VirtualSensor(SensorDesign().scaled(0.5), 0)
    return lambda state: np.asarray(sensor.frame(state, averaged=1, stream="another"), np.uint8)


@pytest.fixture(scope="module")
def balanced(virtual_calibration: Calibration) -> Reconstructor:
    return Reconstructor(virtual_calibration, effort="balanced")


@pytest.fixture(scope="module")
def frame(virtual_session: Path) -> Frame:
    return as_camera(read_image(virtual_session / "presses" / f"{PRESS}.png").rgb)


@pytest.mark.parametrize("effort", EFFORTS)
def test_without_a_contact_nothing_is_solved_at_any_effort(
    effort: str, shown: Callable[[State], Frame], virtual_calibration: Calibration
) -> None:
    """Another frame than the calibration's, with its own noise."""
    heightmap = Reconstructor(virtual_calibration, effort=effort).depth(shown(BareMembrane()))
    assert heightmap.trace is not None
    assert heightmap.trace.done == ("contact detection",)
    assert "integration" in heightmap.trace.left_out
    assert not heightmap.depth_mm.any()
    assert heightmap.normals is not None
    assert (heightmap.normals == [0.0, 0.0, -1.0]).all()
    assert set(np.unique(heightmap.flags)) == {0, Flag.OUTSIDE, Flag.OUTSIDE | Flag.INVALID}


@pytest.mark.parametrize("effort", ["balanced", "best"])
@settings(
    max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
    st.floats(0.05, 1.2),
    st.booleans(),
)
def test_the_region_of_a_contact_changes_the_depth_by_micrometres(
    effort: str,
    balanced: Reconstructor,
    shown: Callable[[State], Frame],
    centre_mm: tuple[float, float],
    depth_mm: float,
    round_end: bool,
) -> None:
    indenter = Ball(3.0, depth_mm) if round_end else Cylinder(3.0, depth_mm)
    surface = pressed(indenter, x_mm=centre_mm[0], y_mm=centre_mm[1])
    image = shown(PressedMembrane(surface))
    region, whole = (
        balanced.solver.depth(image, Wanted(effort, normals=False, everywhere=e))
        for e in (False, True)
    )
    assert region.depth_mm.max() > 0.5 * depth_mm
    assert np.abs(region.depth_mm - whole.depth_mm).max() < REGION_MM


@pytest.mark.parametrize("name", [PRESS, "cuboid_s4_d100"])
def test_half_scale_is_near_to_the_best(
    name: str,
    balanced: Reconstructor,
    virtual_session: Path,
    virtual_calibration: Calibration,
) -> None:
    """In an image of half the size, whose nodes are twice as far apart as a camera's."""
    image = as_camera(read_image(virtual_session / "presses" / f"{name}.png").rgb)
    best = Reconstructor(virtual_calibration).depth(image)
    planned = balanced.depth(image)
    off = planned.depth_mm - best.depth_mm
    plateau = best.depth_mm > 0.95 * best.depth_mm.max()
    assert abs(np.median(off[plateau])) < 0.01 * best.depth_mm.max()
    assert np.sqrt(np.mean(off**2)) < 6e-3
    assert best.normals is not None
    assert planned.normals is not None
    across = np.linalg.norm(np.cross(planned.normals, best.normals), axis=-1)
    assert np.median(np.degrees(np.arcsin(np.clip(across[plateau], 0.0, 1.0)))) < 1.0
    same = (planned.flags & Flag.OUTSIDE) == (best.flags & Flag.OUTSIDE)
    assert same.all()


@pytest.mark.parametrize(("decay_mm", "output"), [(0.7, False), (0.1, True)])
@pytest.mark.parametrize("effort", EFFORTS)
def test_walls_that_light_does_not_decide_are_reported_at_every_effort(
    effort: str,
    decay_mm: float,
    output: bool,
    shown: Callable[[State], Frame],
    virtual_calibration: Calibration,
) -> None:
    """Walls of 57 degrees, and of 84."""
    surface = pressed(Cylinder(5.0, 1.0), x_mm=0.5, y_mm=0.3, decay_mm=decay_mm)
    image = shown(PressedMembrane(surface))
    notes = Reconstructor(virtual_calibration, effort=effort).depth(image).findings
    assert any(note.key == "steep_walls" for note in notes) is output


@pytest.mark.parametrize("effort", EFFORTS)
def test_a_trace_says_what_was_done_and_why(
    effort: str, frame: Frame, virtual_calibration: Calibration
) -> None:
    reconstruct = Reconstructor(virtual_calibration, effort=effort)
    trace = reconstruct.depth(frame, normals=False).trace
    assert trace is not None
    assert trace.effort == effort
    reasons = {step.name: step.reason for step in trace.steps}
    assert "of the field" in reasons["contact detection"]
    assert reasons["normals"]
    assert all(step.milliseconds is not None for step in trace.steps if step.done)
    assert isinstance(reconstruct.solver, NearLightSolver)
    numbers = reconstruct.solver.maps.membrane
    assert ("gloss" in trace.left_out) is (numbers.gloss is None)
    assert ("interreflection" in trace.left_out) is (numbers.interreflection == 0.0)


@pytest.mark.parametrize("model", ["paper", "full"])
def test_what_a_frame_needs_is_known_without_reconstructing_it(
    model: str, frame: Frame, shown: Callable[[State], Frame], virtual_calibration: Calibration
) -> None:
    reconstruct = Reconstructor(virtual_calibration, model=model)
    for image in (frame, shown(BareMembrane())):
        needed, found = reconstruct.needs(image), reconstruct.depth(image).trace
        assert found is not None
        asked = {"normals", "standard deviations", "second near-light round"}
        assert set(needed.done) == set(found.done) - asked
        assert set(needed.left_out) <= set(found.left_out)


def test_a_result_is_not_touched_by_the_next_frames(frame: Frame, balanced: Reconstructor) -> None:
    first = balanced.depth(frame)
    kept = first.depth_mm.copy()
    balanced.depth(frame[::-1, ::-1].copy())
    np.testing.assert_array_equal(first.depth_mm, kept)


def test_several_threads_may_ask_at_once(frame: Frame, balanced: Reconstructor) -> None:
    expected = balanced.depth(frame).depth_mm
    frames = [frame, frame[::-1].copy()] * 4
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(balanced.depth, frames))
    for heightmap in found[::2]:
        np.testing.assert_array_equal(heightmap.depth_mm, expected)


def test_bit_depth_and_float_images_give_the_same_depth(
    frame: Frame, balanced: Reconstructor
) -> None:
    eight = balanced.depth(frame).depth_mm
    for other in (frame.astype(np.uint16) * 257, frame.astype(np.float32) / np.float32(255.0)):
        assert np.abs(balanced.depth(other).depth_mm - eight).max() < 1e-3


def test_standard_deviations_are_those_of_the_best_answer(
    frame: Frame, virtual_calibration: Calibration
) -> None:
    stated = Reconstructor(virtual_calibration, effort="fast").depth(frame, uncertainty=True)
    best = Reconstructor(virtual_calibration).depth(frame)
    np.testing.assert_array_equal(stated.depth_mm, best.depth_mm)
    assert stated.trace is not None
    assert stated.trace.effort == "best"
