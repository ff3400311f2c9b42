"""A height map, its Reconstructor's stand-in, and the small virtual sensor."""

from __future__ import annotations

import numpy as np
import pytest

from gelpolight_core.reconstruction.heightmap import Flag, HeightMap

PITCH_MM = 0.1


@pytest.fixture
def dome() -> HeightMap:
    """Return a ball's cap, 0.8 mm deep, in a round working area of 8 mm radius."""
    x = np.arange(-90, 91) * PITCH_MM
    y = np.arange(-85, 86) * PITCH_MM
    xx, yy = np.meshgrid(x, y)
    depth = np.maximum(0.8 - (np.hypot(xx - 2.0, yy + 1.0) / 3.0) ** 2, 0.0)
    slope_y, slope_x = np.gradient(depth, PITCH_MM)
    normals = np.stack([-slope_x, -slope_y, -np.ones_like(depth)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flags = np.where(np.hypot(xx, yy) > 8.0, Flag.OUTSIDE.value, 0).astype(np.uint8)
    flags[80:90, 40:50] |= np.uint8(Flag.DARK.value)
    return HeightMap(
        depth_mm=depth.astype(np.float32),
        x_mm=x,
        y_mm=y,
        pitch_mm=PITCH_MM,
        normals=normals.astype(np.float32),
        flags=flags,
        calibration_id="test",
        model="full",
        source="dome.png",
    )
