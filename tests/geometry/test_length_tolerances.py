"""What the tolerances of stated lengths do agrees with rays through a changed sensor."""

import numpy as np
import pytest

from gelpolight_core.geometry.length_tolerances import (
    HEIGHT_BY_RADIUS,
    INDEX_SD,
    RADIUS_SD,
    SQUARE_SD,
    THICKNESS_SD,
    stated_sd,
)
from gelpolight_core.geometry.refraction import LayerStack, build_stack, radius_on_membrane


def stack(square: float = 1.0, thickness: float = 1.0, index: float = 1.0) -> LayerStack:
    """Return a sensor's layers with a stated length off by a factor."""
    return build_stack(
        39.0 * square, elastomer_thickness_mm=14.0 * thickness, elastomer_index=1.41 * index
    )


def radius_mm(layers: LayerStack) -> float:
    """Return where a ray near the axis meets the membrane."""
    return float(radius_on_membrane(np.array([0.02]), layers)[0][0])


def test_lengths_across_follow_the_rays_of_a_sensor_that_is_otherwise_than_stated():
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
        float(np.hypot((1.0 + HEIGHT_BY_RADIUS) * found.lateral, HEIGHT_BY_RADIUS * RADIUS_SD)),
        rel=1e-9,
    )


@pytest.mark.parametrize("off_sd", [0.001, 0.01])
def test_balls_that_look_as_stated_leave_as_much_doubt_as_drawn_sensors(off_sd):
    """Of many sensors with lengths off as stated, those whose balls look alike scatter so much."""
    prior, random = stated_sd(stack()), np.random.default_rng(0)
    lateral = random.normal(0.0, prior.lateral, 2_000_000)
    radius = random.normal(0.0, RADIUS_SD, lateral.size)
    looks = lateral - radius + random.normal(0.0, off_sd, lateral.size)
    height = lateral + HEIGHT_BY_RADIUS * (lateral - radius)
    for off in (0.0, 0.004):
        alike = np.abs(looks - off) < 2e-4
        found = stated_sd(stack(), (off, off_sd))
        seen = np.sqrt([np.mean(height[alike] ** 2), np.mean(lateral[alike] ** 2)])
        assert found.depth == pytest.approx(seen[0], rel=0.03)
        assert found.lateral == pytest.approx(seen[1], rel=0.03)
    assert stated_sd(stack(), (0.0, off_sd)).lateral < prior.lateral
    blind = stated_sd(stack(), (0.0, 1e6))
    assert blind == pytest.approx(prior)
