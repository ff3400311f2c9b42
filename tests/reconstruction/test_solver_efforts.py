"""What the solver leaves out at each effort, and that it changes no more than is stated."""

from concurrent.futures import ThreadPoolExecutor

import known_press
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import SolveRequest
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import BallIndenter, CuboidIndenter, CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign

Frame = NDArray[np.unsignedinteger]
# What a region of the contact may change: drape below half a degree, and depth 0 at its border.
REGION_MM = 8e-3
PRESSES = {"cylinder": CylinderIndenter(5.0, 1.0), "cuboid": CuboidIndenter(4.0, 1.0)}


@pytest.fixture(scope="module")
def known():
    """Return the virtual sensor at half its size, with its exact calibration."""
    return known_press.known_sensor(SensorDesign().scaled(0.5))


@pytest.fixture(scope="module")
def bare(known):
    return known.noisy(known.bare(), seed=1)


@pytest.fixture(scope="module")
def balanced(known):
    return Reconstructor(known.calibration, effort="balanced")


@pytest.fixture(scope="module")
def frame(known):
    return known.noisy(
        known_press.on(known, PRESSES["cylinder"], x_mm=1.2, y_mm=-0.8, samples=2).frame
    )


@pytest.mark.parametrize("effort", EFFORTS)
def test_without_a_contact_nothing_is_solved_at_any_effort(effort, known, bare):
    heightmap = Reconstructor(known.calibration, effort=effort).depth(bare)
    assert heightmap.trace.done == ("contact detection",)
    assert "integration" in heightmap.trace.skipped_names
    assert not heightmap.depth_mm.any()
    assert heightmap.normals is not None
    assert (heightmap.normals == [0.0, 0.0, -1.0]).all()
    assert set(np.unique(heightmap.flags)) == {0, Flag.OUTSIDE}


@pytest.mark.parametrize("effort", ["balanced", "best"])
@settings(
    max_examples=2, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)), st.floats(0.05, 1.2), st.booleans())
def test_the_region_of_a_contact_changes_the_depth_by_micrometres(
    effort, balanced, known, centre_mm, depth_mm, round_end
):
    indenter = BallIndenter(3.0, depth_mm) if round_end else CylinderIndenter(3.0, depth_mm)
    press = known_press.on(known, indenter, x_mm=centre_mm[0], y_mm=centre_mm[1])
    image = known.noisy(press.frame)
    region, whole = (
        balanced.solver.depth(image, SolveRequest(effort, normals=False, everywhere=e))
        for e in (False, True)
    )
    assert region.depth_mm.max() > 0.5 * depth_mm
    assert np.abs(region.depth_mm - whole.depth_mm).max() < REGION_MM


@pytest.mark.function("Reconstruct at three efforts")
@pytest.mark.parametrize("name", PRESSES)
def test_half_scale_is_near_to_the_best(name, balanced, known):
    """In an image of half the size, whose nodes are twice as far apart as a camera's."""
    image = known.noisy(known_press.on(known, PRESSES[name], x_mm=-1.3, y_mm=0.6, samples=2).frame)
    best = Reconstructor(known.calibration).depth(image)
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


def test_a_trace_says_what_was_done_and_what_the_membrane_does_not_need(frame, known):
    for effort in EFFORTS:
        trace = Reconstructor(known.calibration, effort=effort).depth(frame, normals=False).trace
        assert trace.effort == effort
        assert all(step.milliseconds is not None for step in trace.steps if step.done)
        assert "gloss" not in trace.skipped_names
        assert "interreflection" in trace.skipped_names


@pytest.mark.parametrize("model", ["paper", "full"])
def test_what_a_frame_needs_is_known_without_reconstructing_it(model, frame, bare, known):
    reconstruct = Reconstructor(known.calibration, model=model)
    for image in (frame, bare):
        needed, found = reconstruct.needs(image), reconstruct.depth(image).trace
        asked = {"normals", "standard deviations", "second near-light round"}
        assert set(needed.done) == set(found.done) - asked
        assert set(needed.skipped_names) <= set(found.skipped_names)


def test_a_result_is_not_touched_by_the_next_frames(frame, balanced):
    first = balanced.depth(frame)
    kept = first.depth_mm.copy()
    balanced.depth(frame[::-1, ::-1].copy())
    np.testing.assert_array_equal(first.depth_mm, kept)


def test_several_threads_may_ask_at_once(frame, balanced):
    expected = balanced.depth(frame).depth_mm
    frames = [frame, frame[::-1].copy()] * 2
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(balanced.depth, frames))
    for heightmap in found[::2]:
        np.testing.assert_array_equal(heightmap.depth_mm, expected)


def test_standard_deviations_are_those_of_the_best_answer(frame, known):
    stated = Reconstructor(known.calibration, effort="fast").depth(frame, uncertainty=True)
    best = Reconstructor(known.calibration).depth(frame)
    np.testing.assert_array_equal(stated.depth_mm, best.depth_mm)
    assert stated.trace.effort == "best"
    assert "effort fast" in stated.trace.skipped_names
