"""One point on the membrane: values, and position in the camera image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.compared_quantity import value_text
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

STRIDE = 8
FLAG_WORDS = {
    Flag.OUTSIDE: "outside the working area",
    Flag.SATURATED: "saturated",
    Flag.DARK: "in shadow",
    Flag.EXTRAPOLATED: "outside the reflectance curve",
    Flag.NOT_OBSERVABLE: "wall faces away",
    Flag.INVALID: "no light model here",
    Flag.UNANCHORED: "no zero level: nearly all of the boundary is pressed",
}


@dataclass(frozen=True, slots=True)
class PointReading:
    """Values of a height map at one point. NaN if unknown."""

    x_mm: float
    y_mm: float
    depth_mm: float
    slope_deg: float
    depth_sd_mm: float
    flags: int

    def detail(self) -> str:
        """Return what belongs to the depth: deviation, position, slope, flags."""
        parts = [f"at x {self.x_mm:.2f}, y {self.y_mm:.2f} mm; slope {self.slope_deg:.1f}°"]
        if math.isfinite(self.depth_sd_mm):
            parts.insert(0, f"± {value_text(self.depth_sd_mm)} (1 sd)")
        words = (word for flag, word in FLAG_WORDS.items() if self.flags & flag.value)
        return "\n".join([*parts, ", ".join(words)]).strip()


def read_at(heightmap: HeightMap, x_mm: float, y_mm: float) -> PointReading | None:
    """Return the values at a point, or None outside the map."""
    pitch = heightmap.pitch_mm
    column = round((x_mm - float(heightmap.x_mm[0])) / pitch)
    row = round((y_mm - float(heightmap.y_mm[0])) / pitch)
    depth = heightmap.depth_mm
    rows, columns = depth.shape
    if not (0 <= row < rows and 0 <= column < columns):
        return None
    left, right = max(column - 1, 0), min(column + 1, columns - 1)
    above, below = max(row - 1, 0), min(row + 1, rows - 1)
    slope_x = float(depth[row, right] - depth[row, left]) / (pitch * (right - left))
    slope_y = float(depth[below, column] - depth[above, column]) / (pitch * (below - above))
    return PointReading(
        x_mm=x_mm,
        y_mm=y_mm,
        depth_mm=float(depth[row, column]),
        slope_deg=math.degrees(math.atan(math.hypot(slope_x, slope_y))),
        depth_sd_mm=_total_sd(heightmap, row, column),
        flags=int(heightmap.flags[row, column]),
    )


def _total_sd(heightmap: HeightMap, row: int, column: int) -> float:
    """Noise, model and calibration combined, as in the height map's own description."""
    if heightmap.depth_sd_mm is None:
        return math.nan
    parts = [float(heightmap.depth_sd_mm[row, column])]
    if heightmap.depth_model_sd_mm is not None:
        parts.append(float(heightmap.depth_model_sd_mm[row, column]))
    if heightmap.depth_scale_sd is not None:
        parts.append(heightmap.depth_scale_sd * float(heightmap.depth_mm[row, column]))
    return math.hypot(*parts)


class PixelMap:
    """Converts between points on the membrane and camera pixels.

    Parameters
    ----------
    table : ResamplingTable
        Positions of the grid nodes in the camera image.
    """

    def __init__(self, table: ResamplingTable) -> None:
        self._table = table
        valid = table.valid[::STRIDE, ::STRIDE]
        self._u = np.where(valid, table.u_px[::STRIDE, ::STRIDE], np.inf)
        self._v = np.where(valid, table.v_px[::STRIDE, ::STRIDE], np.inf)

    def pixel_of(
        self, x_mm: float, y_mm: float, depth_mm: NDArray[np.float32] | None = None
    ) -> tuple[float, float] | None:
        """Return the pixel (u, v) that sees a point, or None."""
        grid = self._table.grid
        column, row = grid.to_index(np.array([x_mm, y_mm]))
        node = self._inside(row, column)
        if node is None:
            return None
        if depth_mm is not None:
            ray_slope = self._table.ray_slope[node] * depth_mm[node] / grid.pitch_mm
            node = self._inside(row - float(ray_slope[1]), column - float(ray_slope[0])) or node
        if not self._table.valid[node]:
            return None
        return float(self._table.u_px[node]), float(self._table.v_px[node])

    def point_of(
        self, u: float, v: float, depth_mm: NDArray[np.float32] | None = None
    ) -> tuple[float, float] | None:
        """Return the point (x, y) in mm that a pixel sees, or None if it is not on the membrane."""
        if not (math.isfinite(u) and math.isfinite(v)):
            return None
        square_distance = (self._u - u) ** 2 + (self._v - v) ** 2
        row, column = (
            STRIDE * int(n)
            for n in np.unravel_index(np.argmin(square_distance), square_distance.shape)
        )
        if not math.isfinite(float(square_distance.min())):
            return None
        top, left = max(row - STRIDE, 0), max(column - STRIDE, 0)
        near = np.s_[top : row + STRIDE + 1, left : column + STRIDE + 1]
        fine = (self._table.u_px[near] - u) ** 2 + (self._table.v_px[near] - v) ** 2
        down, across = np.unravel_index(np.argmin(fine), fine.shape)
        node = top + int(down), left + int(across)
        # Neighbouring nodes at the edge of the image are at most a few pixels apart.
        if float(fine.min()) > 25.0:
            return None
        grid = self._table.grid
        point = np.array([grid.x_mm[node[1]], grid.y_mm[node[0]]])
        if depth_mm is not None:
            point = point + self._table.ray_slope[node] * depth_mm[node]
        return float(point[0]), float(point[1])

    def _inside(self, row: float, column: float) -> tuple[int, int] | None:
        rows, columns = self._table.valid.shape
        node = round(row), round(column)
        return node if 0 <= node[0] < rows and 0 <= node[1] < columns else None
