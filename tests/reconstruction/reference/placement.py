"""Plain oracle of the move from the camera's rays to true positions on the metric grid."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]
ROUNDS = 14
FOLDED = 0.05


def place_on_grid(
    depth_mm: Map, ray_slope: Map, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]
) -> tuple[Map, Map, NDArray[np.bool_]]:
    """Find, for every true position, the ray that sees the surface there.

    The ray of node P0 sees the surface at P0 + depth * ray_slope; the inverse is found by damped
    fixed-point steps, which converge wherever the camera sees the surface at all.

    Parameters
    ----------
    depth_mm : (rows, columns)
        Depth at each node's ray.
    ray_slope : (rows, columns, 2)
        Sideways move of the ray per mm of depth.
    x_mm, y_mm : (columns,), (rows,)
        Nodes.

    Returns
    -------
    column, row : (rows, columns) float32
        Where in the ray grid each true position is seen; for :func:`cv2.remap`.
    folded : (rows, columns) bool
        Positions that no ray sees, or that lie behind a wall.
    """
    pitch = np.float32(x_mm[1] - x_mm[0])
    rows, columns = depth_mm.shape
    grid_column, grid_row = np.meshgrid(
        np.arange(columns, dtype=np.float32), np.arange(rows, dtype=np.float32)
    )
    # The move in nodes, known on the ray grid.
    move_x = np.ascontiguousarray(depth_mm * ray_slope[..., 0] / pitch, np.float32)
    move_y = np.ascontiguousarray(depth_mm * ray_slope[..., 1] / pitch, np.float32)
    column, row = grid_column.copy(), grid_row.copy()
    for _ in range(ROUNDS):
        dx = cv2.remap(move_x, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        dy = cv2.remap(move_y, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        column = 0.5 * (column + grid_column - dx)
        row = 0.5 * (row + grid_row - dy)
    dx = cv2.remap(move_x, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    dy = cv2.remap(move_y, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    missed = np.hypot(column + dx - grid_column, row + dy - grid_row)
    return column, row, missed > FOLDED + 0.5


def resample(values: Map, column: Map, row: Map, *, nearest: bool = False) -> Map:
    """Return values of the ray grid at the places found by :func:`place_on_grid`.

    Parameters
    ----------
    values : (rows, columns) float32
        On the ray grid.
    column, row : (rows, columns) float32
        Where to read them.
    nearest : bool, optional
        Take the nearest value, as for flags; else bilinear.
    """
    how = cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR
    return np.asarray(cv2.remap(values, column, row, how, borderMode=cv2.BORDER_REPLICATE))
