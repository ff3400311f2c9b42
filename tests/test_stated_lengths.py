"""What the tolerances of stated lengths do agrees with rays through a changed sensor."""

from __future__ import annotations

import numpy as np
import pytest

from gelpolight_core.optics.refraction import LayerStack, build_stack, radius_on_membrane
from gelpolight_core.stated_lengths import (
    HEIGHT_BY_RADIUS,
    INDEX_SD,
    RADIUS_SD,
    SQUARE_SD,
    THICKNESS_SD,
    stated_sd,
)


def stack(square: float = 1.0, thickness: float = 1.0, index: float = 1.0) -> LayerStack:
    """Return a sensor's layers with a stated length off by a factor."""
    return build_stack(
        39.0 * square, elastomer_thickness_mm=14.0 * thickness, elastomer_index=1.41 * index
    )


def radius_mm(layers: LayerStack) -> float:
    """Return where a ray near the axis meets the membrane."""
    return float(radius_on_membrane(np.array([0.02]), layers)[0][0])


def test_lengths_across_follow_the_rays_of_a_sensor_that_is_otherwise_than_stated() -> None:
    usual = radius_mm(stack())
    moved = [
        radius_mm(changed) / usual - 1.0
        for changed in (
            stack(square=1.0 + SQUARE_SD),
            stack(thickness=1.0 + THICKNESS_SD),
            stack(index=1.0 + INDEX_SD),
        )
    ]
    found = stated_sd(stack())
    assert found.lateral == pytest.approx(float(np.linalg.norm(moved)), rel=0.02)
    assert found.depth == pytest.approx(
        float(np.hypot(found.lateral, HEIGHT_BY_RADIUS * RADIUS_SD)), rel=1e-9
    )
