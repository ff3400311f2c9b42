"""The surface as rows of nodes from rim to rim, for a mesh with a smooth edge."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.heightmap import Flag, HeightMap

# Coarse while live: a software renderer draws so many nodes in time. The texture has the detail.
LIVE_NODES = 160


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """What the 3D view needs.

    Attributes
    ----------
    x_mm : (rows, columns) float32
        Nodes of a row, evenly from one side of the working area to the other.
    y_mm : (rows,) float32
        Of the rows.
    depth_mm : (rows, columns) float32
        At the nodes.
    extent_mm : (left, top, right, bottom)
        Of the texture, sensor frame.
    texture : (rows, columns, 3) uint8
        Shaded colours.
    """

    x_mm: NDArray[np.float32]
    y_mm: NDArray[np.float32]
    depth_mm: NDArray[np.float32]
    extent_mm: tuple[float, float, float, float]
    texture: NDArray[np.uint8]

    def thinned(self, largest: int) -> Surface:
        """Return it with no more nodes than this a side; the texture keeps its detail."""
        rows, columns = self.depth_mm.shape
        down = np.linspace(0, rows - 1, min(rows, largest)).round().astype(int)
        across = np.linspace(0, columns - 1, min(columns, largest)).round().astype(int)
        nodes = np.ix_(down, across)
        return replace(
            self, x_mm=self.x_mm[nodes], y_mm=self.y_mm[down], depth_mm=self.depth_mm[nodes]
        )

    def depth_at(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of the node nearest to each place; -inf off the surface."""
        rows, columns = self.depth_mm.shape
        step = float(self.y_mm[-1] - self.y_mm[0]) / (rows - 1)
        row = np.rint((y_mm - self.y_mm[0]) / step).astype(int)
        held = np.clip(row, 0, rows - 1)
        left, right = self.x_mm[held, 0], self.x_mm[held, -1]
        column = np.rint((x_mm - left) / (right - left) * (columns - 1)).astype(int)
        inside = (row == held) & (column >= 0) & (column < columns)
        found = self.depth_mm[held, np.clip(column, 0, columns - 1)]
        return np.where(inside, found.astype(np.float64), -np.inf)


def surface_of(
    heightmap: HeightMap,
    texture: NDArray[np.uint8],
    *,
    largest: int | None = None,
    depth_mm: NDArray[np.float32] | None = None,
) -> Surface | None:
    """Return the surface of a height map.

    Parameters
    ----------
    heightmap : HeightMap
        Its working area decides where the surface ends.
    texture : (rows, columns, 3) uint8
        Colours over all of the grid.
    largest : int, optional
        No more nodes than this a side; without it, all.
    depth_mm : (rows, columns), optional
        The height map's depth averaged to fewer pixels, which is quicker to be sampled.

    Returns
    -------
    surface : Surface or None
        None where nothing lies in the working area.
    """
    depth = heightmap.depth_mm if depth_mm is None else depth_mm
    inside = heightmap.flags & Flag.OUTSIDE.value == 0
    used = np.flatnonzero(inside.any(axis=1))
    if used.size < 2:
        return None
    share = 1.0 if largest is None else min(largest / max(inside.shape), 1.0)
    rows = np.linspace(used[0], used[-1], max(round(share * used.size), 2))
    nearest = inside[np.rint(rows).astype(int)]
    first = nearest.argmax(axis=1)
    last = inside.shape[1] - 1 - nearest[:, ::-1].argmax(axis=1)
    # A row of one node would be no row.
    last = np.maximum(last, first + 1)
    columns = max(round(share * inside.shape[1]), 2)
    along = np.linspace(0.0, 1.0, columns)
    column = (first[:, None] + (last - first)[:, None] * along).astype(np.float32)
    row = np.repeat(rows[:, None], columns, axis=1).astype(np.float32)
    scale = depth.shape[1] / inside.shape[1]
    side = 2 * int(0.5 * scale / share) + 1
    smooth = cv2.blur(depth, (side, side)) if side > 1 else depth
    sampled = cv2.remap(
        smooth,
        (column + 0.5) * np.float32(scale) - np.float32(0.5),
        (row + 0.5) * np.float32(scale) - np.float32(0.5),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    pitch, left, top = heightmap.pitch_mm, float(heightmap.x_mm[0]), float(heightmap.y_mm[0])
    half = 0.5 * pitch
    extent = (left - half, top - half, float(heightmap.x_mm[-1]) + half,
              float(heightmap.y_mm[-1]) + half)  # fmt: skip
    return Surface(
        x_mm=(left + pitch * column).astype(np.float32),
        y_mm=(top + pitch * rows).astype(np.float32),
        depth_mm=np.asarray(sampled, np.float32),
        extent_mm=extent,
        texture=texture,
    )
