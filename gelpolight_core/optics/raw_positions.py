"""Position of membrane grid nodes in the raw image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.resampling import ResamplingTable

Array = NDArray[np.float64]


def seen_at(table: ResamplingTable, nodes: Array) -> Array:
    """Return the raw pixels (M, 2) of fractional nodes (N, 2) (column, row).

    Nodes that the camera does not see are left out.
    """
    if len(nodes) == 0:
        return np.zeros((0, 2))
    at = np.asarray(nodes, np.float32).reshape(-1, 1, 2)
    seen = (table.u_px >= 0.0).astype(np.float32)
    u, v, whole = (
        cv2.remap(plane, at[..., 0], at[..., 1], cv2.INTER_LINEAR)[:, 0]
        for plane in (table.u_px, table.v_px, seen)
    )
    # Next to an invisible node, its -1 would be mixed in.
    return np.stack([u, v], axis=-1).astype(np.float64)[whole > 0.999]


def boundary_px(table: ResamplingTable) -> Array:
    """Return the border of the working area (N, 2), in raw pixels."""
    borders, _ = cv2.findContours(
        table.valid.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    longest = max(borders, key=len)[::4, 0] if borders else np.zeros((0, 2))
    return seen_at(table, np.asarray(longest, np.float64))


def working_area(table: ResamplingTable, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the working area as a mask (rows, columns) of the raw image."""
    area = np.zeros(shape, np.uint8)
    boundary = boundary_px(table)
    if len(boundary) > 2:
        cv2.fillPoly(area, [np.round(boundary).astype(np.int32)], (1.0,))
    return area > 0
