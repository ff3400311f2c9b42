"""The steps that a user chooses for the height map of a frozen image."""

from dataclasses import replace

import numpy as np
import pytest

from app.views.map.display_processing import MapProcessor, ProcessingSteps, process_map
from gelpolight_core.measurement.area import Rectangle


@pytest.fixture
def tilted(dome):
    """Return the dome on a plane that falls along x."""
    return replace(dome, depth_mm=dome.depth_mm + 0.02 * dome.x_mm.astype(np.float32))


@pytest.mark.parametrize(
    "steps",
    [
        ProcessingSteps(level="plane"),
        ProcessingSteps(level="rectangle", rectangle=Rectangle((-5.0, 0.0), (8.0, 2.0), 90.0)),
        ProcessingSteps(level="points", points_mm=((-5.0, -4.0), (-5.0, 4.0), (3.0, 5.0))),
    ],
    ids=lambda steps: steps.level,
)
def test_each_levelling_leaves_the_dome_on_a_level_surface(dome, tilted, steps):
    done = process_map(tilted, steps)
    assert done.refused == "" and len(done.steps) == 1
    np.testing.assert_allclose(done.heightmap.depth_mm, dome.depth_mm, atol=2e-3)


def test_a_frozen_map_is_processed_once_for_the_same_steps(dome):
    process = MapProcessor()
    steps = ProcessingSteps(level="plane")
    first = process(dome, steps)
    assert process(dome, replace(steps)) is first
    assert process(dome, replace(steps, level="surface")) is not first
    assert process(dome, ProcessingSteps()).heightmap is dome
