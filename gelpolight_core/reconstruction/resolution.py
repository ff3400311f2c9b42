"""Depth that the deepest top of a map loses by the distance of the nodes.

A node's light is the mean over its area, an average of variance h**2 / 12 along each axis, and the
trapezoids of the integration average its slopes once more: a smooth surface loses h**2 / 8 of its
Laplacian. A tip or an edge that is finer than the nodes loses more. The Laplacians over one and
over two nodes tell them apart: they agree on a smooth surface, and on a kink the first is twice the
second. This gives the order p by which the error decreases with h, and with it Richardson's
estimate, (d(h) - d(2 h)) / (2**p - 1).
"""

from __future__ import annotations

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array

REACH = 4
"""Nodes around the deepest one in which the top is looked for: the edge of a face may overshoot by
its neighbours' noise, but not its average."""


def lost_at_top(depth_mm: Float32Array) -> tuple[float, float]:
    """Return the depth of the deepest top and the part of it that the nodes take, in mm.

    Parameters
    ----------
    depth_mm : (rows, columns) float32
        Depth at the solved nodes.
    """
    column, row = cv2.minMaxLoc(depth_mm)[3]
    wide = REACH + 2
    near = depth_mm[max(row - wide, 0) : row + wide + 1, max(column - wide, 0) : column + wide + 1]
    if min(near.shape) < 5:
        return float(depth_mm[row, column]), 0.0
    average = cv2.GaussianBlur(near, (5, 5), 1.0)[2:-2, 2:-2]
    i, j = (int(n) + 2 for n in np.unravel_index(np.argmax(average), average.shape))
    top = float(near[i, j])

    def bent(step: int) -> float:
        beside = near[i - step, j] + near[i + step, j] + near[i, j - step] + near[i, j + step]
        return (4.0 * top - float(beside)) / (8.0 * step**2)

    smooth, wider = bent(1), bent(2)
    if smooth <= 0.0:
        return top, 0.0
    kinked = float(np.clip(smooth / wider, 1.0, 2.0)) if wider > 0.0 else 2.0
    return top, 3.0 * smooth / (4.0 / kinked - 1.0)
