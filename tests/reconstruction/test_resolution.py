"""What the nodes take from fine tips is stated, with a warning where it is much."""

from collections.abc import Callable
from functools import cache

import known_press
import numpy as np
import pytest

from gelpolight_core.base.finding import Verdict
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.resolution import lost_at_top
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import (
    BallIndenter,
    CuboidIndenter,
    CylinderIndenter,
    Indenter,
    ReliefIndenter,
)
from gelpolight_core.studies.exact_sensor import matt_design

Maps = Callable[[str, str], HeightMap]
H = 0.1


def around(height_mm: float, radius_mm: float) -> ReliefIndenter:
    """Return a bar with a round back (0: a cone) of a height above its base."""
    cells = 0.0125 * np.arange(-120, 121)
    x, y = np.meshgrid(cells, cells)
    if radius_mm == 0.0:
        return ReliefIndenter(1.5 - np.hypot(x, y), 0.0125, height_mm)
    back = np.sqrt(np.maximum(radius_mm**2 - y**2, 0.0))
    return ReliefIndenter(np.where(np.abs(y) < radius_mm, back, np.nan), 0.0125, height_mm)


OBJECTS: dict[str, Indenter] = {
    "ball 2": BallIndenter(2.0, 0.6),
    "ball 0.5": BallIndenter(0.5, 0.4),
    "ball 0.25": BallIndenter(0.25, 0.2),
    "needle": around(0.5, 0.0),
    "wire 0.3": around(0.2, 0.15),
    "cylinder": CylinderIndenter(5.0, 1.0),
    "cuboid": CuboidIndenter(4.0, 1.0),
    "wide cuboid": CuboidIndenter(6.0, 1.0),
    "plate": CylinderIndenter(6.0, 0.05),
    "square plate": CuboidIndenter(6.0, 0.05),
}


@pytest.fixture(scope="module")
def known():
    """Return a matt sensor of 640 x 480 pixels, without an error of the calibration."""
    return known_press.known_sensor(matt_design(0.5))


@pytest.fixture(scope="module")
def sensor(known):
    """Return its reconstructor."""
    return Reconstructor(known.calibration)


@pytest.fixture(scope="module")
def pressed(known, sensor):
    """Return what gives the map of an object at an effort, of one noisy image each."""

    @cache
    def frame(name: str) -> np.ndarray:
        light = known_press.on(known, OBJECTS[name], x_mm=1.23, y_mm=-0.77, samples=2).frame
        return known.noisy(light, seed=1)

    def at(name: str, effort: str) -> HeightMap:
        return sensor.at_effort(effort).depth(frame(name))

    return at


def test_a_smooth_top_loses_an_eighth_of_its_laplacian():
    x, y = np.meshgrid(*[H * np.arange(-20, 21) + 0.03] * 2)
    depth = np.maximum(1.0 - (x**2 + y**2) / 4.0, 0.0).astype(np.float32)
    top, lost = lost_at_top(depth)
    assert top == pytest.approx(1.0, abs=2e-3)
    assert lost == pytest.approx(H**2 / 8.0, rel=0.02)


def test_a_kink_loses_in_proportion_to_the_distance_of_the_nodes():
    """The mean of a cone of slope 1 over a square node is 0.38 of the node below its tip."""
    x, y = np.meshgrid(*[H * np.arange(-20, 21)] * 2)
    sharp = np.maximum(1.0 - np.hypot(x, y), 0.0).astype(np.float32)
    assert 0.38 * H < lost_at_top(sharp)[1] < 4 * 0.38 * H
    assert lost_at_top(sharp[::2, ::2])[1] == pytest.approx(2.0 * lost_at_top(sharp)[1], rel=0.01)


@pytest.mark.parametrize("tilt", [0.0, 0.005])
def test_a_face_loses_nothing_although_its_edge_is_sharp(tilt):
    x, y = np.meshgrid(*[H * np.arange(-40, 41)] * 2)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, x.shape)
    away = np.maximum(np.maximum(np.abs(x), np.abs(y)) - 2.0, 0.0)
    depth = ((1.0 + tilt * x) * np.exp(-away / 0.7) + noise).astype(np.float32)
    assert lost_at_top(depth)[1] < 3e-3
    assert lost_at_top(depth[:4]) == (float(depth[:4].max()), 0.0)


@pytest.mark.parametrize(
    ("name", "effort"), [("ball 2", "best"), ("ball 0.5", "balanced"), ("ball 0.25", "fast")]
)
def test_small_balls_are_within_their_deviations(pressed, name, effort):
    ball = OBJECTS[name]
    assert isinstance(ball, BallIndenter)
    found = measure_heightmap(pressed(name, effort), shape="ball")
    assert abs(found.height_mm - ball.depth_mm) < 3.0 * found.sd["height_mm"]
    assert abs(found.size_mm - 2.0 * ball.radius_mm) < 3.0 * found.size_sd_mm
    # Not more than is needed: a ball of 4 mm loses next to nothing at full scale.
    if name == "ball 2":
        assert found.sd["height_mm"] < 0.005


@pytest.mark.parametrize(
    ("name", "efforts"),
    [("needle", EFFORTS), ("ball 0.25", EFFORTS[:2]), ("wire 0.3", EFFORTS[:1])],
)
def test_tips_finer_than_the_nodes_are_doubtful(pressed, name, efforts):
    for effort in efforts:
        found = pressed(name, effort)
        assert [f.key for f in found.doubtful_findings] == ["too_coarse"]
        lost = OBJECTS[name].depth_mm - found.depth_mm.max()
        assert lost > 0.02 * OBJECTS[name].depth_mm
        (note,) = found.doubtful_findings
        assert note.verdict is Verdict.WARN


@pytest.mark.parametrize(
    "effort",
    ["balanced", *(pytest.param(e, marks=pytest.mark.long) for e in ("fast", "best"))],
)
def test_what_the_nodes_resolve_is_not_doubted(pressed, effort):
    for name in ("ball 2", "cylinder", "cuboid", "plate", "square plate"):
        assert not pressed(name, effort).doubtful_findings


@pytest.mark.parametrize(
    ("name", "shape", "effort"),
    [("plate", "cylinder", "best"), ("square plate", "cuboid", "fast")],
)
def test_shallow_plates_are_within_their_deviations(pressed, name, shape, effort):
    found = measure_heightmap(pressed(name, effort), shape=shape)
    off_mm = found.height_mm - OBJECTS[name].depth_mm
    assert abs(off_mm) < 2.0 * found.sd["height_mm"]
    assert found.sd["height_mm"] < 2e-3


def test_an_edge_is_not_taken_for_a_large_fillet_where_nodes_do_not_resolve_the_drape(pressed):
    found = measure_heightmap(pressed("wide cuboid", "fast"), shape="cuboid")
    assert found.edge_radius_mm == pytest.approx(0.05, abs=0.1)
    assert abs(found.size_mm - 6.0) < 2.0 * found.size_sd_mm
