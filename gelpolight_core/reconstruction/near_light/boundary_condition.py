"""Where the boundary of a solved region is free, decided from the solved depth.

Depth 0 just outside the boundary is correct where the membrane is at rest. It is wrong where a
contact crosses the boundary (physics chapter, integration). The brightness does not show this: a
flat face looks almost like the untouched membrane. The first round is therefore integrated with
depth 0 on the whole boundary. If the depth next to the boundary is not 0, it is integrated again
with a free boundary: parts above the lowest level are pressed and stay free, and the others are set
to depth 0 again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.reconstruction.frame_checks import PRESSED_SHARE

from .kernel_structures import GridRegion

STRIP_MM = 0.5
"""Width of the strip next to the boundary whose depth is judged."""
LEFT_MM, LEFT_SHARE = 0.005, 0.01
"""Depth in the strip, and share of the largest depth, above which a contact reaches it. Drape alone
gives less; a contact that crosses the boundary gives half its depth."""
LEFT_SLOPE, STEEPEST_PERCENT, SMOOTHED = 0.5, 99.0, 5
"""Share of the slope with which membrane decays from the depth that is left in the strip: what a
contact brings is steeper somewhere. Where errors of walls far away have left the depth, the strip
is as flat as membrane at rest. Slopes are averaged over 5 x 5 nodes against noise, and the steepest
hundredth is left out."""
"""Share of the largest boundary depth above which a node of the free boundary is pressed: more than
the light error of the first round. A smaller drape decays to 3 um over `REACH_MM`."""
REACH_MM = 2.5
"""The boundary is free within this distance of pressed nodes: 3.5 decay lengths of 0.7 mm."""
LOWEST_PERCENT = 5.0
"""Percentile of the depth that counts as membrane at rest, where the boundary is free."""
ONE_SIDED_SD = 0.03
"""Relative error of depths behind a straight wall, by the share of the boundary that is free: at
a half 1.3 % at full scale was seen where the noise states 0.1 %. Around a closed outline the errors
of walls that face different lights cancel; behind one wall they do not."""
HOLLOW_SHARE = 0.25
"""Membrane at rest is never higher than this share of the largest depth; its bulge around a contact
is much smaller."""


class BoundaryCondition(NamedTuple):
    """Boundary condition of a region at the coarsest scale.

    Attributes
    ----------
    free : (rows, columns) bool or None
        Where a contact crosses the boundary of the field; None where none does.
    cut : bool
        Whether the depth is not 0 where the region ends inside the field: the region is too small.
    rest : (rows, columns) bool or None
        Where the lowest depth counts as membrane at rest, because too little of the boundary is at
        rest; None where depth 0 at the boundary is the anchor.
    level_sd_mm : float
        Uncertainty common to all depths; 0 where the boundary is the anchor.
    depth_sd : float
        Relative standard deviation of depths that are integrated across the walls of one side
        only; it grows with the share of the field's boundary that is free.
    """

    free: BoolArray | None = None
    cut: bool = False
    rest: BoolArray | None = None
    level_sd_mm: float = 0.0
    depth_sd: float = 0.0

    def levelled(self, depth_mm: Float32Array) -> Float32Array:
        """Return a depth (rows, columns) of any scale with its membrane at rest at 0."""
        if self.rest is None:
            return depth_mm
        step = depth_mm.shape[0] // self.rest.shape[0]
        level = np.percentile(depth_mm[::step, ::step][self.rest], LOWEST_PERCENT)
        return np.asarray(depth_mm - np.float32(level))


class BoundaryStrips(NamedTuple):
    """Strips (rows, columns) next to the boundary of a region.

    Attributes
    ----------
    inside : bool
        All of the field.
    edge : bool
        Inside the field, next to its boundary.
    beyond : bool
        `edge`, and all that lies outside the field.
    inner : bool
        Next to where the region ends inside the field.
    edge_nodes : int
        Nodes of such a strip around the whole field.
    """

    inside: BoolArray
    edge: BoolArray
    beyond: BoolArray
    inner: BoolArray
    edge_nodes: int


def rim_distance_mm(inside: BoolArray, pitch_mm: float) -> Float32Array:
    """Return how far nodes (rows, columns) are from the nearest one outside the field or grid."""
    padded = np.pad(inside.astype(np.uint8), 1)
    return np.asarray(cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1] * pitch_mm)


def region_strips(distance_mm: Float32Array, region: GridRegion, pitch_mm: float) -> BoundaryStrips:
    """Return the strips of a region.

    Parameters
    ----------
    distance_mm : (grid rows, grid columns)
        As :func:`rim_distance_mm` returns it.
    region : GridRegion
        Nodes of the grid.
    pitch_mm : float
        Distance between nodes.
    """
    region_mm = distance_mm[region.window(1)]
    # The nodes next to the boundary are one pitch from those outside.
    reach_mm = max(STRIP_MM, pitch_mm)
    beyond = region_mm <= reach_mm
    around = int(np.count_nonzero((distance_mm > 0.0) & (distance_mm <= reach_mm)))
    width = max(round(STRIP_MM / pitch_mm), 1)
    inner = np.zeros(region.shape, bool)
    # Rows, and then columns by the transposed view.
    for axis, side in enumerate((inner, inner.T)):
        if region.corner[axis] > 0:
            side[:width] = True
        if region.corner[axis] + region.shape[axis] < distance_mm.shape[axis]:
            side[-width:] = True
    inside = region_mm > 0.0
    return BoundaryStrips(inside, beyond & inside, beyond, inner & ~beyond, around)


def find_boundary(
    held_mm: Float32Array,
    strips: BoundaryStrips,
    integrate: Callable[[BoolArray | None], Float32Array],
    pitch_mm: float,
    slopes: tuple[Float32Array, Float32Array],
    decay_mm: float,
) -> BoundaryCondition:
    """Return where the boundary is free.

    Parameters
    ----------
    held_mm : (rows, columns)
        Depth of the first round, with depth 0 on the whole boundary.
    strips : BoundaryStrips
        Strips of the region.
    integrate : callable (free) -> depth
        Integrates the same slopes with the boundary free where a mask (rows, columns) says so.
    pitch_mm : float
        Distance between nodes.
    slopes : 2 of (rows, columns)
        Slopes along x and y that were integrated.
    decay_mm : float
        Decay length of the membrane.
    """
    reached = _left(held_mm, strips.edge) and _falls(held_mm, slopes, strips.edge, decay_mm)
    if not (reached or _hollow(held_mm)):
        return BoundaryCondition(cut=_left(held_mm, strips.inner))
    ends_inside = bool(strips.inner.any())
    open_mm = integrate(strips.beyond)
    # Where the region ends inside the field, the membrane there is at rest.
    lowest = 0.0 if ends_inside else np.percentile(open_mm[strips.inside], LOWEST_PERCENT)
    above_mm = open_mm - np.float32(lowest)
    highest_mm = float(above_mm[strips.edge].max(initial=0.0))
    pressed = strips.edge & (above_mm > max(LEFT_MM, PRESSED_SHARE * highest_mm))
    if not pressed.any():
        return BoundaryCondition(cut=_left(held_mm, strips.inner))
    size = 2 * max(round(REACH_MM / pitch_mm), 1) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    free = (cv2.dilate(pressed.astype(np.uint8), disc) > 0) & strips.beyond
    share = np.count_nonzero(strips.edge & free) / strips.edge_nodes
    if ends_inside:
        cut = _left(integrate(free), strips.inner)
        return BoundaryCondition(free, cut, depth_sd=ONE_SIDED_SD * share)
    # A boundary of which less than a tenth is fixed at depth 0 is not a reliable anchor.
    if share > 0.9:
        return BoundaryCondition(strips.beyond, rest=strips.inside, level_sd_mm=highest_mm)
    return BoundaryCondition(free, depth_sd=ONE_SIDED_SD * share)


def _hollow(depth_mm: Float32Array) -> bool:
    """Return whether a part lies above the boundary, which shows that the boundary is pressed."""
    return float(depth_mm.min()) < -max(LEFT_MM, HOLLOW_SHARE * float(depth_mm.max()))


def _left(depth_mm: Float32Array, strip: BoolArray) -> bool:
    """Return whether depth is left in a strip."""
    if not strip.any():
        return False
    deepest = float(np.abs(depth_mm).max())
    return float(np.abs(depth_mm[strip]).max()) > LEFT_MM + LEFT_SHARE * deepest


def _falls(
    depth_mm: Float32Array,
    slopes: tuple[Float32Array, Float32Array],
    strip: BoolArray,
    decay_mm: float,
) -> bool:
    """Return whether slopes in a strip explain the depth that is left there."""
    across, down = (cv2.blur(slope, (SMOOTHED, SMOOTHED))[strip] for slope in slopes)
    steepest = float(np.percentile(np.hypot(across, down), STEEPEST_PERCENT))
    return steepest * decay_mm > LEFT_SLOPE * float(np.abs(depth_mm[strip]).max())
