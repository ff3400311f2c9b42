"""The camera as seen from a point of the membrane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def view_directions(ray_slope: Array) -> Array:
    """Return unit directions (..., 3) back along the rays, from their slopes (..., 2)."""
    view = np.concatenate([ray_slope, -np.ones_like(ray_slope[..., :1])], axis=-1)
    return np.asarray(view / np.linalg.norm(view, axis=-1, keepdims=True))
