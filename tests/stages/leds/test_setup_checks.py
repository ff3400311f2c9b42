"""The stated set-up is judged before anything is captured with it, and against the pose."""

from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.stages.leds.setup_checks import judge_set_up, judge_set_up_by_pose


@pytest.mark.function(
    "Be told that a stated number of the set-up is unusual, or contradicts the measured pose"
)
@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        ({}, []),
        ({"elastomer_refractive_index": 1.0}, ["stated_index"]),
        ({"elastomer_refractive_index": 14.1}, ["stated_index"]),
        ({"led_height_mm": 20.0}, ["led_outside_elastomer"]),
        ({"elastomer_thickness_mm": 7.0}, ["led_outside_elastomer"]),
    ],
)
def test_unusual_numbers_are_named(small_calibration, changes, keys):
    sensor = replace(small_calibration.data.sensor, **changes)

    assert [finding.key for finding in judge_set_up(sensor, 4.0)] == keys


def test_a_ball_larger_than_the_working_area_is_unusual(small_calibration):
    (finding,) = judge_set_up(small_calibration.data.sensor, 317.5)

    assert finding.key == "ball_over_field"


def test_the_measured_pose_contradicts_wrong_numbers(small_calibration):
    c = small_calibration.data
    low = np.array(c.led_positions_mm)
    low[:, :2] *= 10.0 / 12.0
    low[:, 2] = -5.0
    wide = replace(c.sensor, working_diameter_mm=2.0 * c.sensor.working_diameter_mm)
    true = judge_set_up_by_pose(c.sensor, c.camera, c.plane, c.led_positions_mm)
    lower = judge_set_up_by_pose(c.sensor, c.camera, c.plane, low)
    wider = judge_set_up_by_pose(wide, c.camera, c.plane, c.led_positions_mm)

    assert not true
    assert [finding.key for finding in lower] == ["led_in_view"]
    assert "field_over_view" in {finding.key for finding in wider}
