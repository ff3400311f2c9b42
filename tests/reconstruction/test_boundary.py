"""Contacts that cross the boundary of the field: right, or flagged as without an anchor."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import known_press
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.measurement.object_measurement import measure_object
from gelpolight_core.reconstruction.frame_checks import (
    fixed_boundary_note,
    free_boundary_note,
    unanchored_note,
)
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import BallIndenter, CylinderIndenter
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.studies.exact_sensor import ExactPress, ExactSensor, matt_design
from gelpolight_core.studies.image_case_helpers import depth_error, rms_um

Array = NDArray[np.float64]
CELL_MM, HALF_MM = 0.05, 15.0
AXIS = CELL_MM * np.arange(-round(HALF_MM / CELL_MM), round(HALF_MM / CELL_MM) + 1)
DECAY_MM = 0.7
DEPTH_MM = 1.0
SEEN_MM = 12.0


@cache
def sensor() -> ExactSensor:
    """Return a sensor of 640 x 480 pixels with its exact calibration; its field is 26 mm wide."""
    return known_press.known_sensor(matt_design(0.5))


def draped(outside_mm: Array, depth_mm: float = DEPTH_MM) -> ExactPress:
    """Return a press of a flat face from its distance to the outline, positive outside."""
    depth = depth_mm * np.exp(-np.maximum(outside_mm, 0.0) / DECAY_MM)
    first = float(AXIS[0])
    return sensor().showing(PressedSurface(depth, outside_mm <= 0.0, first, first, CELL_MM), 1)


@cache
def scene(name: str) -> ExactPress:
    """Return a press across the boundary."""
    x, y = np.meshgrid(AXIS, AXIS)
    kind, _, number = name.partition(" ")
    if kind == "cylinder":
        width, at = (float(n) for n in number.split(" at "))
        return known_press.on(sensor(), CylinderIndenter(width, DEPTH_MM), x_mm=at)
    outlines: dict[str, Callable[[], Array]] = {
        # Pressed over this share of the field's boundary.
        "edge": lambda: 12.0 * np.cos(np.pi * float(number)) - x,
        "half": lambda: -y,
        "quadrant": lambda: np.hypot(np.maximum(-x, 0.0), np.maximum(-y, 0.0)),
        "ring": lambda: float(number) - np.hypot(x, y),
    }
    return draped(outlines[kind]())


def error_um(found: HeightMap, press: ExactPress) -> float:
    return rms_um(depth_error(found, press.truth, radius_mm=SEEN_MM))


@pytest.mark.parametrize(
    ("name", "effort"),
    [
        ("cylinder 12 at 11", "best"),
        ("edge 0.5", "best"),
        ("half plane", "fast"),
        ("quadrant", "best"),
    ],
)
def test_a_flat_face_across_the_boundary_keeps_its_depth(name, effort):
    """Held at depth 0 all around, or freed by brightness, these are 80 to 480 um off."""
    press = scene(name)
    found = Reconstructor(sensor().calibration, effort=effort).depth(press.frame, normals=False)
    # A straight wall across the whole field gives its own error to all that lies behind it.
    assert error_um(found, press) < (30.0 if name in ("edge 0.5", "half plane") else 15.0)
    assert free_boundary_note() in found.findings
    assert not (found.flags & int(Flag.UNANCHORED)).any()


@pytest.mark.parametrize(("effort", "depth_mm"), [("fast", 0.1), ("best", 0.05)])
def test_a_shallow_face_that_goes_on_beyond_the_region_is_solved_whole(effort, depth_mm):
    """Only its edge changes the light: the region around the edge ends on the face.

    Half of the field is a little brighter: this is the face, and no change of exposure.
    """
    x, _ = np.meshgrid(AXIS, AXIS)
    press = draped(-x, depth_mm)
    reconstructor = Reconstructor(sensor().calibration, effort=effort)
    for frame in (press.frame, sensor().noisy(press.frame)):
        found = reconstructor.depth(frame, normals=False)
        assert error_um(found, press) < 4.0
        assert not found.health.findings


def test_the_stated_deviation_covers_what_a_far_face_is_off_by():
    press = scene("edge 0.5")
    found = Reconstructor(sensor().calibration).depth(press.frame, uncertainty=True)
    assert found.depth_sd_mm is not None
    assert found.depth_model_sd_mm is not None
    seen = (found.flags & int(Flag.OUTSIDE)) == 0
    x, _ = np.meshgrid(found.x_mm, found.y_mm)
    sd = np.hypot(found.depth_sd_mm, found.depth_model_sd_mm)
    near, far = (np.median(sd[seen & part]) for part in (x < -10.0, x > 10.0))
    assert far > 2.0 * near
    face = seen & (x > 2.0) & (x < 10.0)
    off = np.abs(found.depth_mm[face] - DEPTH_MM)
    assert np.mean(off < 3.0 * sd[face]) > 0.95


def test_a_face_all_around_is_levelled_by_the_hole_and_says_that_it_has_no_anchor():
    press = scene("ring 8")
    found = Reconstructor(sensor().calibration).depth(press.frame, uncertainty=True)
    assert error_um(found, press) < 10.0
    assert unanchored_note() in found.findings
    inside = (found.flags & int(Flag.OUTSIDE)) == 0
    assert (found.flags[inside] & int(Flag.UNANCHORED)).all()
    assert np.median(found.depth_model_sd_mm[inside]) > 0.5 * DEPTH_MM


@pytest.mark.parametrize(("effort", "x_mm"), [("fast", 12.0), ("best", 10.5)])
def test_what_the_boundary_cuts_off_is_not_measured(x_mm, effort):
    press = scene(f"cylinder 12 at {x_mm:g}")
    found = Reconstructor(sensor().calibration, effort=effort).depth(press.frame, normals=False)
    with pytest.raises(InputError, match="cut by the border"):
        measure_object(found, shape="cylinder")


def test_the_papers_model_says_that_it_holds_the_boundary_down():
    press = scene("cylinder 12 at 10.5")
    paper = Reconstructor(sensor().calibration, model="paper")
    found = paper.depth(press.frame)
    assert fixed_boundary_note() in found.findings
    measured = measure_object(found, shape="cylinder")
    assert measured.verdict == "doubtful"
    central = known_press.on(sensor(), BallIndenter(4.0, DEPTH_MM), x_mm=1.0)
    assert not paper.depth(central.frame).findings


def test_a_face_without_an_anchor_is_doubtful():
    """A block in the middle of a field whose boundary is pressed all around."""
    press = known_press.on(sensor(), CylinderIndenter(5.0, DEPTH_MM))
    found = Reconstructor(sensor().calibration).depth(press.frame)

    def verdict(flags: NDArray[np.uint8]) -> str:
        return measure_object(replace(found, flags=flags), shape="cylinder").verdict

    assert verdict(found.flags) == "ok"
    assert verdict(found.flags | np.uint8(Flag.UNANCHORED)) == "doubtful"
