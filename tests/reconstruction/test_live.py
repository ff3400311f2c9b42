"""What the planned reconstruction leaves out, and that it changes no more than is stated."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.reconstruction import live
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.plan import EFFORTS
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.terms import Terms
from gelpolight_core.reflectance.membrane import CURVE_NODES
from gelpolight_core.session.session import read_picture
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
    return as_camera(read_picture(virtual_session / "presses" / f"{PRESS}.png").rgb)


def test_without_a_contact_nothing_is_solved(
    balanced: Reconstructor, shown: Callable[[State], Frame]
) -> None:
    """Another frame than the calibration's, with its own noise."""
    heightmap = balanced.depth(shown(BareMembrane()))
    assert heightmap.plan is not None
    assert heightmap.plan.done == ("looking for a contact",)
    assert "integration" in heightmap.plan.left_out
    assert not heightmap.depth_mm.any()
    assert heightmap.normals is not None
    assert (heightmap.normals == [0.0, 0.0, -1.0]).all()
    assert set(np.unique(heightmap.flags)) == {0, Flag.OUTSIDE}


@settings(
    max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
    st.floats(0.05, 1.2),
    st.booleans(),
)
def test_the_region_of_a_contact_changes_the_depth_by_micrometres(
    balanced: Reconstructor,
    shown: Callable[[State], Frame],
    centre_mm: tuple[float, float],
    depth_mm: float,
    round_end: bool,
) -> None:
    indenter = Ball(3.0, depth_mm) if round_end else Cylinder(3.0, depth_mm)
    surface = pressed(indenter, x_mm=centre_mm[0], y_mm=centre_mm[1])
    picture = shown(PressedMembrane(surface))
    region, whole = (
        balanced.live.depth(picture, effort="balanced", normals=False, everywhere=e)
        for e in (False, True)
    )
    assert region.depth_mm.max() > 0.5 * depth_mm
    assert np.abs(region.depth_mm - whole.depth_mm).max() < REGION_MM


@settings(
    max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.floats(0.01, 0.06))
def test_one_round_is_enough_for_a_shallow_press(
    balanced: Reconstructor, shown: Callable[[State], Frame], depth_mm: float
) -> None:
    surface = pressed(Cylinder(3.0, depth_mm), x_mm=1.0, y_mm=-2.0)
    picture = shown(PressedMembrane(surface))
    once = balanced.depth(picture)
    assert once.depth_mm.max() > 0.5 * depth_mm
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live, "SHALLOW_MM", 0.0)
        twice = balanced.depth(picture)
    assert np.abs(once.depth_mm - twice.depth_mm).max() < 1e-3


@pytest.mark.parametrize("name", [PRESS, "cuboid_s4_d100"])
def test_half_scale_is_near_to_the_best(
    name: str,
    balanced: Reconstructor,
    virtual_session: Path,
    virtual_calibration: Calibration,
) -> None:
    """In a picture of half the size, whose nodes are twice as far apart as a camera's."""
    picture = as_camera(read_picture(virtual_session / "presses" / f"{name}.png").rgb)
    best = Reconstructor(virtual_calibration).depth(picture)
    planned = balanced.depth(picture)
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


@pytest.mark.parametrize(("decay_mm", "said"), [(0.7, False), (0.1, True)])
@pytest.mark.parametrize("effort", EFFORTS)
def test_walls_that_light_does_not_decide_are_said_at_every_effort(
    effort: str,
    decay_mm: float,
    said: bool,
    shown: Callable[[State], Frame],
    virtual_calibration: Calibration,
) -> None:
    """Walls of 57 degrees, and of 84."""
    surface = pressed(Cylinder(5.0, 1.0), x_mm=0.5, y_mm=0.3, decay_mm=decay_mm)
    picture = shown(PressedMembrane(surface))
    notes = Reconstructor(virtual_calibration, effort=effort).depth(picture).notes
    assert any("steep walls" in note for note in notes) is said


def test_the_paper_and_the_best_effort_leave_nothing_out(
    frame: Frame, virtual_calibration: Calibration
) -> None:
    for model in ("paper", "full"):
        plan = Reconstructor(virtual_calibration, model=model).plan(frame, normals=False)
        assert plan.left_out == ("normals", "standard deviations")


def test_a_plan_says_why(balanced: Reconstructor, frame: Frame) -> None:
    plan = balanced.plan(frame, normals=False)
    assert "near light, last round" in plan.done
    reasons = {step.name: step.reason for step in plan.steps}
    assert "of the field" in reasons["looking for a contact"]
    assert reasons["normals"]
    assert all(step.milliseconds is not None for step in plan.steps if step.done)


def test_the_fast_effort_leaves_the_finer_scale_out(
    frame: Frame, balanced: Reconstructor, virtual_calibration: Calibration
) -> None:
    fast = Reconstructor(virtual_calibration, effort="fast").depth(frame)
    assert fast.plan is not None
    assert "near light, half scale" in fast.plan.left_out
    off = fast.depth_mm - balanced.depth(frame).depth_mm
    assert np.sqrt(np.mean(off**2)) < 10e-3


def test_the_number_of_threads_changes_no_bit(
    frame: Frame, balanced: Reconstructor, virtual_calibration: Calibration
) -> None:
    alone = Reconstructor(virtual_calibration, effort="balanced", workers=1).depth(frame)
    both = balanced.depth(frame)
    np.testing.assert_array_equal(alone.depth_mm, both.depth_mm)
    np.testing.assert_array_equal(alone.flags, both.flags)


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


def test_bit_depth_and_float_pictures_give_the_same_depth(
    frame: Frame, balanced: Reconstructor
) -> None:
    eight = balanced.depth(frame).depth_mm
    for other in (frame.astype(np.uint16) * 257, frame.astype(np.float32) / np.float32(255.0)):
        assert np.abs(balanced.depth(other).depth_mm - eight).max() < 1e-3


def test_what_is_not_finite_is_a_missing_channel(frame: Frame, balanced: Reconstructor) -> None:
    bad = frame.astype(np.float32) / 255.0
    bad[200:204, 300:310, 1] = np.nan
    bad[260:262, 280:300] = np.inf
    found = balanced.depth(bad)
    assert np.isfinite(found.depth_mm).all()
    assert np.isfinite(found.normals).all()
    assert (found.flags & Flag.SATURATED).any()


@pytest.mark.parametrize("value", [0, 255])
def test_an_even_picture_is_survived(value: int, frame: Frame, balanced: Reconstructor) -> None:
    assert np.isfinite(balanced.depth(np.full_like(frame, value)).depth_mm).all()


def test_terms_left_out_and_standard_deviations_are_not_planned(
    frame: Frame, virtual_calibration: Calibration
) -> None:
    """They are solved as by the best effort."""
    terms = Terms(shadows=False)
    planned = Reconstructor(virtual_calibration, effort="balanced", terms=terms).depth(frame)
    best = Reconstructor(virtual_calibration, terms=terms).depth(frame)
    np.testing.assert_array_equal(planned.depth_mm, best.depth_mm)
    assert planned.plan is not None
    assert "by hand" in planned.plan.steps[0].reason


def test_a_membrane_too_bent_for_the_fast_solve_is_solved_by_the_plain_one(
    frame: Frame, virtual_calibration: Calibration
) -> None:
    """A curve with a kink, such as a hand may draw."""
    full = virtual_calibration.full
    assert full is not None
    even = np.linspace(0.0, 1.0, CURVE_NODES)
    kinked = tuple(np.minimum(even, 0.5 + 0.2 * (even - 0.5)).tolist())
    bent = replace(full.membrane, diffuse=(kinked, kinked, kinked))
    calibration = replace(virtual_calibration, full=replace(full, membrane=bent))
    plan = Reconstructor(calibration, effort="balanced").plan(frame)
    assert "bent" in plan.steps[0].reason


def test_an_unknown_effort_is_refused(virtual_calibration: Calibration) -> None:
    with pytest.raises(ValueError, match="some"):
        Reconstructor(virtual_calibration, effort="some")


def test_warming_up_changes_nothing(frame: Frame, virtual_calibration: Calibration) -> None:
    warm, cold = (Reconstructor(virtual_calibration, effort="balanced") for _ in range(2))
    warm.warm_up()
    np.testing.assert_array_equal(warm.depth(frame).depth_mm, cold.depth(frame).depth_mm)
