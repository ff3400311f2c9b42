"""From the slopes of a closed sensor to its depth."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.height_map import COARSE
from gelpolight_core.reconstruction.integration.weighted import FREE, integrate_weighted

CROSSES = 0.08
"""Share of the largest depth at the border above which parts of the border are free ..."""
HELD = 0.02
"""... and up to which a node of the border is fixed at depth 0."""
STEEP_SHARE, REACH_MM = 0.25, 2.0
"""A contact crosses the border within this reach of walls, which have this share of the steepest
slope. Small errors of the slopes over all of the field leave depth at the border, too."""
TOLERANCE, ROUGH_TOLERANCE = 1e-3, 1e-2


def integrate_free_border(
    slope_x: Float32Array,
    slope_y: Float32Array,
    *,
    pitch_mm: float,
    weight: Float32Array,
    workers: RowThreadPool | None = None,
) -> tuple[Float32Array, bool]:
    """Integrate slopes with a border that is free where a contact crosses it.

    A coarse solution with a nearly free border shows where the border is pressed. A second coarse
    solution, free only there, is the start of the fine solution, which adds the details.

    Parameters
    ----------
    slope_x, slope_y : (rows, columns) float32
        d(depth)/dx and d(depth)/dy.
    pitch_mm : float
        Distance between nodes.
    weight : (rows, columns) float32
        Weight of each slope, 0..1.
    workers : RowThreadPool, optional
        Threads; by default one.

    Returns
    -------
    depth_mm : (rows, columns) float32
        At the nodes.
    crossed : bool
        Whether the border is free somewhere.
    """
    rows, columns = slope_x.shape
    size = max(columns // COARSE, 2), max(rows // COARSE, 2)
    small_weight, small_x, small_y = (
        np.asarray(cv2.resize(a, size, interpolation=cv2.INTER_AREA), np.float32)
        for a in (weight, slope_x, slope_y)
    )
    pitch = pitch_mm * columns / size[0]
    # A first, coarse solution holds the whole border at depth 0 with little weight.
    loose = np.full(small_x.shape, 1e-3, np.float32)
    rough = integrate_weighted(
        small_x, small_y, small_weight, pitch_mm=pitch, hold=loose, tolerance=ROUGH_TOLERANCE
    ).depth_mm
    # A map that is nowhere deeper than half a node is not changed.
    firm = _firm(rough, _near_walls(small_x, small_y, pitch), 0.5 * pitch_mm)
    if firm is None:
        whole = integrate_weighted(
            slope_x, slope_y, weight, pitch_mm=pitch_mm, tolerance=TOLERANCE, workers=workers
        )
        return whole.depth_mm, False
    # The weight of a coarse node represents that of its part of the fine border.
    coarse = integrate_weighted(
        small_x, small_y, small_weight, pitch_mm=pitch, hold=firm, tolerance=TOLERANCE
    ).depth_mm
    start = cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_CUBIC)
    hold = cv2.resize(
        cv2.erode(firm, np.ones((3, 3), np.uint8)),
        (columns, rows),
        interpolation=cv2.INTER_LINEAR,
    )
    integral = integrate_weighted(
        slope_x,
        slope_y,
        weight,
        pitch_mm=pitch_mm,
        start_mm=np.asarray(start, np.float32),
        hold=np.asarray(hold, np.float32),
        tolerance=TOLERANCE,
        workers=workers,
    )
    return integral.depth_mm, True


def _near_walls(slope_x: Float32Array, slope_y: Float32Array, pitch_mm: float) -> NDArray[np.bool_]:
    """Return the nodes (rows, columns) within reach of a contact's walls."""
    slope = np.hypot(slope_x, slope_y)
    steep = slope > STEEP_SHARE * float(np.quantile(slope, 0.995))
    side = 2 * max(round(REACH_MM / pitch_mm), 1) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.asarray(cv2.dilate(steep.astype(np.uint8), disc) > 0)


def _firm(rough_mm: Float32Array, near: NDArray[np.bool_], least_mm: float) -> Float32Array | None:
    """Return the weight of depth 0 at the border, or None where it is 1 everywhere."""

    def border(values: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([values[0], values[-1], values[:, 0], values[:, -1]])

    border_mm = border(rough_mm)
    ground = float(np.quantile(border_mm, 0.25))
    max_depth_mm = float(rough_mm.max()) - ground
    max_border_mm = float(border_mm[border(near)].max(initial=ground))
    if max_depth_mm < least_mm or max_border_mm - ground < CROSSES * max_depth_mm:
        return None
    pressed = np.where(near, (rough_mm - ground) / (HELD * max_depth_mm), 0.0)
    return np.asarray(np.clip(2.0 - pressed, FREE, 1.0), np.float32)
