"""The paper's Fig. 1 in numbers: light and method belong together."""

from __future__ import annotations

import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.lighting import LightingRow, compare_lighting, lighting_lines


@pytest.fixture(scope="module")
def rows() -> tuple[LightingRow, ...]:
    return compare_lighting(SensorDesign(), height_shares=(1.0,), elevations_deg=(45.0,))


def test_each_method_is_right_under_its_own_light(rows: tuple[LightingRow, ...]) -> None:
    point, directional = rows
    assert point.near_um is not None and point.parallel_um is not None
    assert directional.near_um is not None and directional.parallel_um is not None
    assert point.near_um < 12.0 < 5.0 * point.near_um < point.parallel_um
    assert directional.parallel_um < 15.0 < 3.0 * directional.parallel_um < directional.near_um


def test_shadows_are_shares_of_the_pressed_membrane(rows: tuple[LightingRow, ...]) -> None:
    for row in rows:
        assert 0.0 <= row.unsolved_percent < row.shadow_percent < 30.0
    text = "\n".join(lighting_lines(rows))
    assert "45 deg" in text and f"{rows[0].near_um:.1f}" in text
