"""A user places a measuring tool on a map, reads it and stores it."""

import json
import math
from typing import Any

import numpy as np
import pytest
from maps import PITCH, made, stated

from gelpolight_core.base.errors import InputError
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.drape import ball_depth, cuboid_depth, cylinder_depth
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.tools.feature_tools import EdgeRadiusTool, PitTool, ScratchTool
from gelpolight_core.measurement.tools.indenter_tools import BallTool
from gelpolight_core.measurement.tools.outline_tools import CircleTool, RectangleTool
from gelpolight_core.measurement.tools.point_tools import AngleTool, DistanceTool, StepHeightTool
from gelpolight_core.measurement.tools.section_tools import ProfileWidthTool
from gelpolight_core.measurement.tools.tool_base import Tool
from gelpolight_core.measurement.tools.tool_placing import first_points, make_tool
from gelpolight_core.measurement.tools.tool_registry import TOOLS, result_as_dict, tool_as_dict
from gelpolight_core.reconstruction.height_map import Flag

EXAMPLES: tuple[Tool, ...] = (
    DistanceTool((0.0, 0.0), (1.0, 2.0)),
    StepHeightTool(Rectangle((-5.0, 0.0), (1.0, 1.0)), Rectangle((0.0, 0.0), (1.0, 2.0), 30.0)),
    ProfileWidthTool((-6.0, 0.0), (6.0, 0.0)),
    AngleTool((1.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    CircleTool(((3.0, 0.2), (-2.0, 1.5), (0.0, -2.5))),
    RectangleTool(Rectangle((0.0, 0.0), (2.0, 1.0), 10.0)),
    PitTool(Rectangle((0.0, 0.0), (2.0, 1.0), 10.0)),
    ScratchTool((-1.0, 0.0), (1.0, 0.5)),
    EdgeRadiusTool((2.4, -0.2), (3.4, -0.2)),
)


def cylinder(**more: Any):
    """Return the map of a cylinder of 5 mm, pressed 1 mm deep at (0.3, -0.2)."""
    return made(
        lambda x, y: cylinder_depth(
            np.hypot(x - 0.3, y + 0.2), cylinder_radius_mm=2.5, height_mm=1.0, decay_mm=0.7
        ),
        **more,
    )


def test_every_tool_is_stored_as_plain_json():
    placed = [make_tool(kind, first_points(kind, (0.0, 0.0))) for kind in TOOLS.values()]
    for tool in (*placed, *EXAMPLES, BallTool()):
        stored = tool_as_dict(tool)
        assert json.loads(json.dumps(stored, allow_nan=False)) == stored
        assert stored["tool"] == tool.name


def test_every_tool_draws_what_it_measured_and_its_result_is_plain_json():
    heightmap = cylinder(**stated(8, 0.002))
    results = [tool.apply(heightmap) for tool in EXAMPLES]
    for result in results:
        stored = result_as_dict(result)
        assert json.loads(json.dumps(stored, allow_nan=False)) == stored
        assert stored["figures"] and stored["verdict"] == result.verdict
        assert result.drawing_mm
        assert all(line.ndim == 2 and line.shape[1] == 2 for line in result.drawing_mm)
    assert results[0].figures[0].label == "distance in the plane"


@pytest.mark.function("Measure a distance")
def test_a_distance_is_reported_in_the_plane_in_space_and_in_depth():
    result = DistanceTool((0.0, 0.0), (3.0, 0.0)).apply(made(lambda x, y: 4.0 / 3.0 * x))
    assert result["distance"].value == 3.0
    assert result["distance_3d"].value == pytest.approx(5.0, rel=1e-6)
    assert result["depth_difference"].value == pytest.approx(4.0, rel=1e-6)
    with pytest.raises(InputError, match="outside the working area"):
        DistanceTool((0.0, 0.0), (30.0, 0.0)).apply(made(lambda x, y: x))


def test_points_placed_by_hand_are_known_to_one_node_and_no_better():
    slope = made(lambda x, y: 0.5 * x, **stated(8, 1e-7))
    result = DistanceTool((0.0, 0.0), (3.0, 0.0)).apply(slope)
    assert result["distance"].sd >= math.sqrt(2.0) * PITCH * 0.999
    assert result["distance"].sd < 3.0 * PITCH
    assert result["depth_difference"].sd == pytest.approx(0.5 * math.sqrt(2.0) * PITCH, rel=0.05)
    angle = AngleTool((2.0, 0.0), (0.0, 0.0), (0.0, 2.0)).apply(slope)["angle"]
    assert math.radians(angle.sd) == pytest.approx(math.hypot(*[PITCH / 2.0] * 4), rel=0.05)
    drawn = RectangleTool(Rectangle((0.0, 0.0), (2.0, 1.0))).apply(slope)
    assert drawn["side_a"].sd >= math.sqrt(2.0) * PITCH
    assert DistanceTool((0.0, 0.0), (3.0, 0.0)).apply(made(lambda x, y: x))["distance"].sd is None


@pytest.mark.function("Measure an angle")
def test_an_angle_is_reported_in_the_plane_and_in_space():
    result = AngleTool((2.0, 0.0), (0.0, 0.0), (0.0, 2.0)).apply(made(lambda x, y: x + y))
    assert result["angle"].value == pytest.approx(90.0)
    # (1, 0, 1) and (0, 1, 1) meet at 60 degrees.
    assert result["angle_3d"].value == pytest.approx(60.0, abs=1e-4)
    with pytest.raises(InputError, match="no length"):
        AngleTool((0.0, 0.0), (0.0, 0.0), (1.0, 0.0)).apply(made(lambda x, y: x))


@pytest.mark.function("Measure a step height")
def test_the_step_of_a_cylinder_is_its_height():
    step = StepHeightTool(
        Rectangle((7.0, 3.0), (1.0, 1.0)), Rectangle((0.3, -0.2), (2.0, 2.0), 20.0)
    )
    result = step.apply(cylinder(**stated(64, 0.004)))
    assert result["step_height"].value == pytest.approx(1.0, abs=2e-3)
    # Averages over 6 x 6 and 10 x 10 blocks of noise that is even over 4 x 4 nodes.
    assert result["step_height"].sd == pytest.approx(0.004 * math.hypot(1 / 5, 1 / 10), rel=0.35)


@pytest.mark.function("Measure a circle from three points")
@pytest.mark.parametrize("around", [(0.0, 0.0, 1.0), (0.3, -0.2, 1.1), (0.1, 0.2, 0.95)])
def test_a_circle_drawn_roughly_snaps_to_the_cylinders_edge(around):
    x, y, share = around
    turns = (0.3, 2.0, 4.4)
    rim = tuple(
        (0.3 + x + 2.5 * share * math.cos(a), -0.2 + y + 2.5 * share * math.sin(a)) for a in turns
    )
    heightmap = cylinder(**stated(8, 0.0))
    snapped = CircleTool(rim).apply(heightmap)
    assert snapped["diameter"].value == pytest.approx(5.0, abs=1.5 * PITCH)
    assert abs(snapped["diameter"].value - 5.0) < 2.0 * snapped["diameter"].sd
    assert snapped["centre_x"].value == pytest.approx(0.3, abs=0.01)
    assert snapped["centre_y"].value == pytest.approx(-0.2, abs=0.01)


def test_a_circle_needs_a_rim():
    with pytest.raises(InputError, match="no circle"):
        CircleTool(((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))).apply(cylinder())
    with pytest.raises(InputError, match="no circle"):
        CircleTool(((0.0, 0.0), (1.0, 1.0))).apply(cylinder())
    with pytest.raises(InputError, match="no edge"):
        CircleTool(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))).apply(made(lambda x, y: 0.0 * x))


@pytest.mark.function("Measure a rectangle")
def test_a_rectangle_on_a_cuboids_face_has_its_depth_without_tilt():
    yaw = math.radians(12.0)

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        along = math.cos(yaw) * (x - 0.4) + math.sin(yaw) * y
        across = math.cos(yaw) * y - math.sin(yaw) * (x - 0.4)
        return cuboid_depth(along, across, side_mm=(5.0, 3.0), height_mm=1.0, decay_mm=0.7)

    heightmap = made(surface, **stated(8, 0.0))
    found = RectangleTool(Rectangle((0.4, 0.0), (3.0, 1.5), 12.0)).apply(heightmap)
    sides = [found[name].value for name in ("side_a", "side_b", "yaw")]
    assert sides == [3.0, 1.5, 12.0]
    assert found["mean_depth"].value == pytest.approx(1.0, abs=1e-6)
    assert found["deepest"].value == pytest.approx(1.0, abs=1e-6)
    assert found["tilt"].value == pytest.approx(0.0, abs=1e-3)
    assert found["sq"].value == pytest.approx(0.0, abs=0.01)


def test_a_fitted_indenter_says_what_the_measurement_says():
    heightmap = made(
        lambda x, y: ball_depth(np.hypot(x, y), ball_radius_mm=3.0, height_mm=0.8, decay_mm=0.7),
        **stated(8, 0.001),
    )
    result = BallTool().apply(heightmap)
    fit = measure_heightmap(heightmap, shape="ball")
    assert result.measurement is not None
    assert result["diameter"].value == fit.diameter_mm
    assert result["height"].sd == fit.sd["height_mm"]
    assert (result.verdict, result.reason) == (fit.verdict, fit.reason)
    assert result["diameter"].value == pytest.approx(6.0, abs=0.01)


def test_what_rests_on_guessed_depths_is_doubtful():
    heightmap = cylinder()
    heightmap.flags[:, 150:] |= int(Flag.SATURATED)
    result = ProfileWidthTool((-6.0, 0.0), (6.0, 0.0)).apply(heightmap)
    assert result.verdict == "doubtful"
    assert "saturated" in result.reason
