"""The slopes of a map: where they come from, and how light and grid smooth them.

A node sees the mean light of what it covers, so its normal is the mean of the normals there, not of
the slopes. The solver removes the blur that it knows from the image, which leaves the second order
of the rest; normals are then moved to true positions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d, gaussian_filter

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.reconstruction.height_map import COARSE, Flag, HeightMap
from gelpolight_core.reconstruction.modes import FULL
from gelpolight_core.reconstruction.near_light.effort_parameters import SETTINGS
from gelpolight_core.reconstruction.near_light.ratio_sampler import removed_blur2
from gelpolight_core.reconstruction.trace import EFFORTS

BILINEAR = 1.0 / 6.0
"""Variance of bilinear sampling in squared nodes, averaged over where it falls between nodes."""
DIFFERENCE = 1.0
"""Standard deviation, in nodes, of the Gaussian whose derivative gives the slopes of a depth: the
same blur in each direction, which differences between neighbours do not have."""
BLUR_SD_PX = 0.1
"""How far the blur of an image may differ from that of the board's edges. On four rendered sensors
the slopes of edges show 0.05 px less to 0.12 px more."""
STEPS = 4
"""Points of a line to a node of the map, which is blurred over at least as much."""
REACH_SIGMAS = 5.0
ENDS = "nearest"
UNKNOWN = Flag.OUTSIDE | Flag.SATURATED | Flag.DARK | Flag.NOT_OBSERVABLE | Flag.INVALID
"""Flags of nodes whose slopes are not used."""


class MapSmoothing(NamedTuple):
    """How a map smooths the slopes of a surface, beside the blur of its image.

    Attributes
    ----------
    node_mm, step_mm : float
        Distance between the solved nodes, and between the points of a line.
    mixes : bool
        Whether normals are averaged by their light, before they become slopes.
    before_mm2, after_mm2, difference_mm2 : float
        Variances of sampling the image, of moving normals or depths to their places, and of taking
        slopes from depths.
    removed_mm2 : float
        Squared blur that the solver removed from the image, to second order.
    removed_step_mm : float
        Distance of the nodes by whose differences this was removed.
    image_blur : (float, float) or None
        Variance of the image's blur and its standard deviation, mm2; None where no board showed it.
    """

    node_mm: float
    step_mm: float
    mixes: bool
    before_mm2: float
    after_mm2: float
    difference_mm2: float
    removed_mm2: float = 0.0
    removed_step_mm: float = 0.0
    image_blur: tuple[float, float] | None = None

    @property
    def nodes_together(self) -> float:
        """How many nodes have one error: those beside each other where slopes follow from depths.

        Along the slope, the errors of a difference cancel.
        """
        return 1.0 if self.difference_mm2 == 0.0 else 2.0 * math.sqrt(math.pi) * DIFFERENCE

    def blur_mm2(self, image_mm2: float) -> float:
        """Return the variance of the map's blur by that of its image."""
        left_mm2 = image_mm2 + self.before_mm2 - self.removed_mm2
        return max(left_mm2, 0.0) + self.after_mm2

    def smoothed(self, slopes: Float64Array, blur_mm2: float) -> Float64Array:
        """Return what a map shows of slopes (lines, n) along lines, `step_mm` apart.

        `blur_mm2` is the variance of the image's blur.
        """
        after_mm2 = self.after_mm2 + self.difference_mm2
        if not self.mixes:
            kernel = self._gaussian(blur_mm2 + self.before_mm2 + after_mm2)
            return np.asarray(correlate1d(slopes, kernel, mode=ENDS))
        before, after = self._kernel(blur_mm2 + self.before_mm2), self._gaussian(after_mm2)
        down = 1.0 / np.sqrt(1.0 + slopes**2)
        across, down = correlate1d(np.stack([slopes * down, down]), before, mode=ENDS)
        moved = correlate1d(across / np.hypot(across, down), after, mode=ENDS)
        return np.asarray(moved / np.sqrt(1.0 - moved**2))

    def _kernel(self, variance_mm2: float) -> Float64Array:
        """Return the kernel of a blur, less what the solver removed of it."""
        kernel = self._gaussian(variance_mm2)
        if self.removed_mm2 == 0.0:
            return kernel
        apart, half = round(self.removed_step_mm / self.step_mm), 0.5 * self.removed_mm2
        bent = np.zeros(2 * apart + 1)
        bent[[0, apart, -1]] = np.array([1.0, -2.0, 1.0]) * half / self.removed_step_mm**2
        removed = 0.5 * np.convolve(bent, bent)
        removed[apart:-apart] -= bent
        removed[2 * apart] += 1.0
        return np.convolve(kernel, removed)

    def _gaussian(self, variance_mm2: float) -> Float64Array:
        steps2 = variance_mm2 / self.step_mm**2
        reach = math.ceil(REACH_SIGMAS * math.sqrt(steps2))
        kernel = np.exp(-0.5 * np.arange(-reach, reach + 1) ** 2 / steps2)
        return np.asarray(kernel / kernel.sum())


def smoothing_of(heightmap: HeightMap) -> MapSmoothing:
    """Return how a map smooths slopes, as far as it states how it was made."""
    pitch, trace, solved = heightmap.pitch_mm, heightmap.trace, are_solved(heightmap)
    step, sampled = pitch / STEPS, BILINEAR * pitch**2
    difference = (DIFFERENCE * pitch) ** 2
    if not solved and heightmap.model != FULL:
        return MapSmoothing(pitch, step, trace is not None, sampled, 0.0, difference)
    # A file does not say by which effort its map was made.
    factor = SETTINGS[EFFORTS[-1] if trace is None else trace.effort].factor
    scale, node = min(factor, COARSE // 2), factor * pitch
    if not solved:
        # Integration makes up for what the nodes of an edge lose of the height.
        return MapSmoothing(node, step, False, 0.0, 0.0, difference)
    lens_px, blur = None, None
    if heightmap.image_blur_mm is not None:
        blur_mm = heightmap.image_blur_mm
        lens_px, blur = blur_mm / pitch, (blur_mm**2, 2.0 * BLUR_SD_PX * pitch * blur_mm)
    removed = removed_blur2(lens_px, scale) * (scale * pitch) ** 2
    moved = BILINEAR * node**2
    return MapSmoothing(node, step, True, sampled, moved, 0.0, removed, scale * pitch, blur)


def are_solved(heightmap: HeightMap) -> bool:
    """Return whether the normals of a map are those that were solved for single nodes."""
    return heightmap.model == FULL and heightmap.normals is not None


def slopes_of(
    heightmap: HeightMap, window: tuple[slice, slice]
) -> tuple[Float64Array, Float64Array, BoolArray]:
    """Return d(depth)/dx and d(depth)/dy in a window of a map, and where they are known.

    They are those that were solved for each node, if the map has such normals: those of the depth
    are also moved by neighbours that could not be solved. Nodes with fewer than three lights, and
    the nodes beside them, are left out: on a wall that one light does not reach, errors of the
    light that the membrane reflects onto itself move the slopes most.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    window : (slice, slice)
        Rows and columns.
    """
    unknown = (heightmap.flags[window] & np.uint8(UNKNOWN)) != 0
    unknown |= ~np.isfinite(heightmap.depth_mm[window])
    # A node beside them sees a part of the shadow, or its difference reaches them.
    known = cv2.dilate(unknown.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0
    if not are_solved(heightmap):
        depth = _filled(heightmap.depth_mm[window])
        slope_x, slope_y = (
            gaussian_filter(depth, DIFFERENCE, order=order, mode=ENDS) / heightmap.pitch_mm
            for order in ((0, 1), (1, 0))
        )
        return slope_x, slope_y, np.asarray(known)
    assert heightmap.normals is not None
    normals = heightmap.normals[window].astype(np.float64)
    slope_x, slope_y = normals[..., 0] / normals[..., 2], normals[..., 1] / normals[..., 2]
    if not heightmap.at_rest.flat:
        places = np.meshgrid(heightmap.x_mm[window[1]], heightmap.y_mm[window[0]])
        at_rest = heightmap.at_rest.slopes(np.stack(places, axis=-1))
        slope_x, slope_y = slope_x + at_rest[..., 0], slope_y + at_rest[..., 1]
    return np.asarray(slope_x), np.asarray(slope_y), np.asarray(known)


def _filled(depth_mm: NDArray[np.float32]) -> Float64Array:
    """Return a depth whose gaps are filled with the mean of what is known around them."""
    missing = ~np.isfinite(depth_mm)
    depth = np.where(missing, 0.0, depth_mm).astype(np.float64)
    total, share = (gaussian_filter(v, DIFFERENCE, mode=ENDS) for v in (depth, 1.0 - missing))
    return np.where(missing, total / np.maximum(share, 1e-9), depth)
