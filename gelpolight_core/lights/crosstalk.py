"""How much of each LED's light the camera's other channels see, from the mirror spots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.lights.mirror import MirrorSpots

Array = NDArray[np.float64]


def crosstalk_from_spots(spots: MirrorSpots) -> Array:
    """Return the matrix M (3, 3) of ``I_raw = M I_true``; column k is LED k, diagonal 1.

    A spot without unsaturated pixels says nothing of the ratio; its column is left without
    crosstalk.
    """
    matrix = np.eye(3)
    for k, spot in enumerate(spots.spots):
        if np.isfinite(spot.colour).all():
            matrix[:, k] = np.maximum(np.asarray(spot.colour) / spot.colour[k], 0.0)
    return matrix


def unmix(rgb: NDArray[np.float32], crosstalk: Array) -> NDArray[np.float32]:
    """Remove crosstalk from linear light (..., 3)."""
    return np.asarray(rgb @ np.linalg.inv(crosstalk).T, dtype=np.float32)
