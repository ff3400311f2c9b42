"""What the rules save, and what they change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gelpolight_core.design_check.known_sensor import known_sensor, matt_design
from gelpolight_core.experiments.leave_out import (
    Frame,
    RuleFigure,
    measure_rules,
    rule_table,
    worthless,
)
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import Cylinder


@pytest.fixture(scope="module")
def figures() -> tuple[RuleFigure, ...]:
    known = known_sensor(matt_design(0.25))
    frames = [
        Frame("empty", known.noisy(known.bare())),
        Frame("pressed", known.noisy(known.pressed(Cylinder(3.0, 0.6), samples=1).frame)),
        Frame("shallow", known.noisy(known.pressed(Cylinder(3.0, 0.03), samples=1).frame)),
    ]
    return measure_rules("matt", known.calibration, frames, repeats=1)


def test_every_rule_keeps_the_bound_that_the_documentation_states(
    figures: tuple[RuleFigure, ...],
) -> None:
    bounds_um = {"empty": 30.0, "beside": 8.0, "second_round": 1.0, "settled": 6.0}
    assert {f.rule for f in figures} == set(bounds_um)
    for figure in figures:
        assert figure.change_um < bounds_um[figure.rule], figure
        assert figure.change_rms_um <= figure.change_um


def test_the_rules_for_empty_frames_are_really_switched_off_and_on(
    figures: tuple[RuleFigure, ...],
) -> None:
    empty = [figure for figure in figures if figure.rule == "empty"]
    assert {figure.effort for figure in empty} == set(EFFORTS)
    # Solved everywhere, an empty frame is not exactly flat.
    assert all(figure.change_um > 0.0 for figure in empty)
    assert "nothing pressed" in rule_table(figures)


def test_a_rule_saves_the_share_of_the_time_without_it(figures: tuple[RuleFigure, ...]) -> None:
    figure = replace(figures[0], with_ms=6.0, without_ms=8.0)
    assert figure.saved_percent == pytest.approx(25.0)


def test_a_rule_that_saves_nothing_anywhere_is_named(figures: tuple[RuleFigure, ...]) -> None:
    one = figures[0]
    idle = replace(one, label="idle", with_ms=99.0, without_ms=100.0)
    useful = replace(idle, label="useful at one effort")
    better = replace(useful, effort="best", with_ms=50.0)
    assert worthless([idle, useful, better]) == ("idle",)
