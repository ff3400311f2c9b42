"""The bench holds the object on the sensor within its limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.sources.virtual_bench import ITEMS, PRESSED, STAGES, VirtualBench, coin_path
from gelpolight_core.simulation.rays import project_through_layers
from gelpolight_core.simulation.sensor_design import SensorDesign

BENCH = VirtualBench(SensorDesign().scaled(0.25))
NUMBERS = st.floats(-1e6, 1e6)


@given(
    st.sampled_from(list(ITEMS)), NUMBERS, NUMBERS, NUMBERS, NUMBERS, NUMBERS, st.integers(-50, 50)
)
def test_everything_stays_within_its_range(item, x, y, yaw, size, depth, pose):
    BENCH.place_object(item)
    scene = BENCH.set_scene(x_mm=x, y_mm=y, yaw_deg=yaw, size_mm=size, depth_mm=depth, pose=pose)
    assert math.hypot(scene.x_mm, scene.y_mm) <= BENCH.reach_mm(scene) * (1 + 1e-12)
    low, high = BENCH.depth_range_mm(scene)
    assert low <= scene.depth_mm <= high
    assert abs(scene.yaw_deg) <= 180.0
    if item in PRESSED:
        low, high = BENCH.size_range_mm()
        assert low <= scene.size_mm <= high
    if item == "ball":
        assert scene.depth_mm <= 0.5 * scene.size_mm
    if item == "checkerboard":
        assert 0 <= scene.pose < BENCH.steps("checkerboard")


@given(st.floats(40.0, 280.0), st.floats(40.0, 200.0))
def test_an_object_is_dragged_to_where_the_camera_sees_the_pointer(u, v):
    BENCH.place_object("ball")
    scene = BENCH.drag_to(u, v)
    position = np.array([scene.x_mm, scene.y_mm, 0.0])
    design = BENCH.design
    back = project_through_layers(design.camera, design.layers, position)
    inside = math.hypot(*position) < BENCH.reach_mm(scene) * (1 - 1e-9)
    if inside:
        # A thousandth of a pixel: the two calculations through the layers share no code.
        assert back == pytest.approx([u, v], abs=1e-3)
    else:
        assert math.hypot(*position) == pytest.approx(BENCH.reach_mm(scene))


def test_every_image_of_a_session_can_be_arranged():
    counts = {stage: BENCH.steps(stage) for stage in STAGES}
    assert counts == {
        "checkerboard": 16, "top_pose": 1, "mirror": 1, "whiteboard": 1, "background": 1,
        "scale": 1, "balls": 10, "presses": 8,
    }  # fmt: skip
    for stage, count in counts.items():
        scenes = {BENCH.show(stage, number) for number in range(count)}
        assert len(scenes) == count
    with pytest.raises(ValueError, match="no 'balls' number 10"):
        BENCH.show("balls", 10)


def test_the_coin_is_pressed_in_moved_and_lifted_without_a_jump():
    scenes = [coin_path(0.1 * tenth) for tenth in range(400)]
    depths, places = (
        np.array([scene.depth_mm for scene in scenes]),
        np.array([(scene.x_mm, scene.y_mm) for scene in scenes]),
    )
    assert depths[0] == depths.max() > 0.5 and depths.min() == 0.0
    assert np.abs(np.diff(depths)).max() <= 0.1 + 1e-9
    assert np.ptp(places, axis=0).min() > 2.0
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 0.3


@pytest.mark.parametrize(
    "touch",
    [
        lambda bench: bench.place_object("ball"),
        lambda bench: bench.set_scene(yaw_deg=3.0),
        lambda bench: bench.drag_to(150.0, 120.0),
        lambda bench: bench.set_conditions(gain_db=1.0),
        lambda bench: bench.switch("dust", True),
        VirtualBench.stop,
    ],
)
def test_an_object_moves_by_itself_until_the_bench_is_touched(touch):
    bench = VirtualBench(BENCH.design)
    assert bench.is_untouched
    bench.play(coin_path)
    assert bench.scene == bench._within(coin_path(0.0)) and not bench.is_untouched
    bench.advance(100.0)
    bench.advance(103.0)
    assert bench.scene == bench._within(coin_path(3.0))
    touch(bench)
    before = bench.scene
    bench.advance(106.0)
    assert bench.scene == before
