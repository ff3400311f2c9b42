"""The paper's Fig. 1 in numbers: light and method belong together."""

from __future__ import annotations

import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.lighting import LightingRow, compare_lighting


@pytest.fixture(scope="module")
def rows() -> tuple[LightingRow, ...]:
    return compare_lighting(SensorDesign(), height_shares=(1.0,), elevations_deg=(45.0,))


def test_each_method_is_right_under_its_own_light(rows: tuple[LightingRow, ...]) -> None:
    point, directional = rows
    assert point.near_um is not None and point.parallel_um is not None
    assert directional.near_um is not None and directional.parallel_um is not None
    assert point.near_um < 12.0 < 5.0 * point.near_um < point.parallel_um
    assert directional.parallel_um < 15.0 < 3.0 * directional.parallel_um < directional.near_um
