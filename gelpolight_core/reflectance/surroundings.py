"""What a point of the membrane sees: the camera, and the membrane around it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Map = NDArray[np.float32]


def view_directions(ray_slope: Array) -> Array:
    """Return unit directions (..., 3) back along the rays, from their slopes (..., 2)."""
    view = np.concatenate([ray_slope, -np.ones_like(ray_slope[..., :1])], axis=-1)
    return np.asarray(view / np.linalg.norm(view, axis=-1, keepdims=True))


def neighbourhood(ratio: Map, valid: NDArray[np.bool_], pitch_mm: float, reach_mm: float) -> Map:
    """Return press over background, averaged over a Gaussian; 1 where it is unknown."""
    known = np.clip(np.where(valid[..., None], ratio, 1.0), 0.0, 4.0).astype(np.float32)
    factor = max(int(reach_mm / pitch_mm / 4.0), 1)
    rows, columns = valid.shape
    small = cv2.resize(known, (columns // factor, rows // factor), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), reach_mm / pitch_mm / factor)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR))
