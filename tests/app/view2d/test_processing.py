"""The steps that a user chooses for the height map of a frozen image."""

from dataclasses import replace

import numpy as np
import pytest

from app.view2d.processing import Processing, Processor, processed
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.map_processing import usable
from gelpolight_core.reconstruction.height_map import Flag


@pytest.fixture
def tilted(dome):
    """Return the dome on a plane that falls along x."""
    return replace(dome, depth_mm=dome.depth_mm + 0.02 * dome.x_mm.astype(np.float32))


@pytest.mark.parametrize(
    "steps",
    [
        Processing(level="plane"),
        Processing(level="rectangle", rectangle=Rectangle((-5.0, 0.0), (2.0, 8.0))),
        Processing(level="points", points_mm=((-5.0, -4.0), (-5.0, 4.0), (3.0, 5.0))),
    ],
    ids=lambda steps: steps.level,
)
def test_each_levelling_leaves_the_dome_on_a_level_surface(dome, tilted, steps):
    done = processed(tilted, steps)
    assert done.refused == "" and len(done.steps) == 1
    np.testing.assert_allclose(done.heightmap.depth_mm, dome.depth_mm, atol=2e-3)


RECTANGLE = Rectangle((0.0, 1.0), (3.0, 2.0))


def test_each_mask_keeps_what_its_name_says(dome):
    x, y = np.meshgrid(dome.x_mm, dome.y_mm)
    inside = (np.abs(x) <= 1.5) & (np.abs(y - 1.0) <= 1.0)
    flags = dome.flags.copy()
    flags[10:20, 30:40] |= np.uint8(Flag.DARK)
    flagged = replace(dome, flags=flags)
    for mask, expected in (
        ("inside", inside),
        ("outside", ~inside),
        ("deeper", dome.depth_mm > 0.2),
        ("sure", flags == 0),
    ):
        steps = Processing(mask=mask, rectangle=RECTANGLE, deeper_mm=0.2)
        done = processed(flagged, steps)
        assert done.refused == "" and len(done.steps) == 1, mask
        np.testing.assert_array_equal(usable(done.heightmap), usable(flagged) & expected)


def test_a_turned_rectangle_keeps_what_it_outlines(dome):
    (x, y), (first, second) = RECTANGLE.centre_mm, RECTANGLE.sides_mm
    turned = Rectangle((x, y), (second, first), 90.0)
    upright, same = (
        processed(dome, Processing(mask="inside", rectangle=area)) for area in (RECTANGLE, turned)
    )
    np.testing.assert_array_equal(usable(upright.heightmap), usable(same.heightmap))


def test_a_median_removes_single_points_and_both_steps_are_named(tilted):
    depth = tilted.depth_mm.copy()
    depth[60, 60] = 3.0
    done = processed(replace(tilted, depth_mm=depth), Processing(level="plane", filter="median"))
    assert float(done.heightmap.depth_mm[60, 60]) == pytest.approx(0.0, abs=0.01)
    assert len(done.steps) == 2


def test_a_frozen_map_is_processed_once_for_the_same_steps(dome):
    process = Processor()
    steps = Processing(filter="gaussian", sigma_mm=0.2)
    first = process(dome, steps)
    assert process(dome, replace(steps)) is first
    assert process(dome, replace(steps, sigma_mm=0.3)) is not first
    assert process(dome, Processing()).heightmap is dome
