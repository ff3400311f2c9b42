"""The pictures of a calibration's result."""

import math
from dataclasses import replace
from pathlib import PurePath

import numpy as np
import pytest

from gelpolight_core.calibration.height_limits import judged_for
from gelpolight_core.calibration.joint_stage import JOINT
from gelpolight_core.calibration.open_ball_stages import REFLECTANCE
from gelpolight_core.measurement.measurable_depth import measurable_depth
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.size_uncertainty import expected_sd
from gelpolight_core.output.report.result_pictures import (
    Bars,
    Field,
    Label,
    Level,
    Line,
    result_pictures,
)
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session_images import read_linear_image


def pictures_of(run):
    return {picture.key: picture for picture in result_pictures(run.calibration, run)}


def marks_of(picture, kind):
    return [mark for mark in picture.marks if isinstance(mark, kind)]


def test_no_text_of_the_plan_lies_on_another_one(small_run):
    """Two balls at one place are named beside each other, and LEDs outside."""
    joint = small_run.results[JOINT]
    balls = (joint.refined.balls[0], *joint.refined.balls[:-1])
    joint = replace(joint, refined=replace(joint.refined, balls=balls))
    plan = pictures_of(replace(small_run, results=small_run.results.having(JOINT, joint)))["plan"]
    labels = marks_of(plan, Label)
    height_mm = max(abs(label.y) for label in labels)
    for k, one in enumerate(labels):
        for other in labels[:k]:
            assert math.hypot(one.x - other.x, one.y - other.y) > 0.1 * height_mm


def test_curves_of_the_uncertainty_are_named_above_their_ends(small_run):
    """No curve strikes a name through."""
    picture = pictures_of(small_run)["uncertainty"]
    ends = {line.role: line.y[-1] for line in marks_of(picture, Line)}
    labels = sorted(marks_of(picture, Label), key=lambda label: label.y)
    assert {label.text for label in labels} == {"height", "diameter"}
    assert [label.role for label in labels] == sorted(ends, key=ends.get)
    assert labels[0].y == pytest.approx(max(ends.values()))
    top = max(max(line.y) for line in marks_of(picture, Line))
    assert labels[1].y >= labels[0].y + 0.1 * top


@pytest.mark.function("See the height error of each ball, the worst first")
def test_the_worst_ball_comes_first_and_presses_without_an_error_are_counted(small_run):
    """The limit of the typical error is none of one press."""
    joint = small_run.results[JOINT]
    errors = np.linspace(0.001, 0.008, len(joint.checked.height_errors))
    errors[1], errors[2] = -0.3, math.nan
    joint = replace(joint, checked=replace(joint.checked, height_errors=errors))
    picture = pictures_of(replace(small_run, results=small_run.results.having(JOINT, joint)))
    (bars,) = marks_of(picture["balls"], Bars)
    assert bars.y[0] == pytest.approx(30.0)
    assert list(bars.y) == sorted(bars.y, reverse=True)
    assert len(bars.y) == len(errors) - 1
    assert f"1 of {len(errors)}" in picture["balls"].caption
    figure = small_run.calibration.quality["joint"]["ball_height_error_percent"]
    typical, limit = marks_of(picture["balls"], Level)
    assert (typical.y, limit.y) == (figure.value, figure.warn_limit)
    assert set(bars.roles) == {"accent"}


def test_a_press_is_marked_as_in_its_own_step(small_run):
    reflectance = small_run.results[REFLECTANCE]
    first, *others = reflectance.table.agreements
    agreements = (replace(first, odd_share=0.9), *others)
    table = replace(reflectance.table, agreements=agreements)
    results = small_run.results.having(REFLECTANCE, replace(reflectance, table=table))
    (bars,) = marks_of(pictures_of(replace(small_run, results=results))["balls"], Bars)
    marked = [n for n, role in zip(bars.names, bars.roles, strict=True) if role == "warn"]
    assert marked == [PurePath(first.name).stem]


def test_a_typical_error_beyond_its_limit_is_marked(small_run):
    tables = judged_for(small_run.calibration.quality, 1e-3)
    calibration = replace(small_run.calibration, quality=tables)
    typical, limit = marks_of(result_pictures(calibration, small_run)[0], Level)
    assert typical.y > limit.y
    assert typical.role == "warn"


def test_the_plan_shows_leds_and_contacts_where_they_are(small_run):
    balls, full = small_run.results[JOINT].refined.balls, small_run.calibration.data.full
    picture = pictures_of(small_run)["plan"]
    rings = {tuple(np.round([line.x.mean(), line.y.mean()], 1)) for line in marks_of(picture, Line)}
    width_mm = small_run.calibration.data.sensor.working_diameter_mm
    assert any(np.ptp(line.x) == pytest.approx(width_mm) for line in marks_of(picture, Line))
    for x, y in (*(ball.centre_mm for ball in balls), *full.led_positions_mm[:, :2]):
        assert any(math.hypot(x - at[0], y - at[1]) < 0.2 for at in rings)
    named = [label for label in marks_of(picture, Label) if label.role == "accent"]
    assert len(named) == len(balls)


def test_the_map_of_what_is_left_lies_where_balls_were_pressed(small_run):
    (field,) = marks_of(pictures_of(small_run)["left"], Field)
    left, right, top, bottom = field.edges
    rows, columns = field.values.shape
    for ball in small_run.results[JOINT].refined.balls:
        x, y = ball.centre_mm
        column = int((x - left) / (right - left) * columns)
        row = int((y - top) / (bottom - top) * rows)
        assert np.isfinite(field.values[row, column])
    assert np.nanpercentile(np.abs(field.values), 90) <= field.reach


def test_the_expected_uncertainty_is_the_one_that_a_measurement_states(small_run):
    """On a clean press, where the fit adds little."""
    (path,) = small_run.session.folder.glob("presses/cylinder_s5_d100.png")
    height_map = measurable_depth(Reconstructor(small_run.calibration), read_linear_image(path))
    found = measure_heightmap(height_map, shape="cylinder")
    expected = expected_sd(small_run.calibration, "cylinder", found.diameter_mm, found.height_mm)
    assert 0.5 < expected["height_mm"] / found.sd["height_mm"] < 1.1
    assert expected["diameter_mm"] < 1.1 * found.sd["diameter_mm"]


def test_a_calibration_alone_shows_what_its_file_holds(small_run):
    pictures = result_pictures(small_run.calibration, None)
    assert [picture.key for picture in pictures] == ["uncertainty", "plan"]
