"""Inputs and outputs of the compiled near-light solver, in named structures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array

Triple = tuple[float, float, float]
NOT_FINITE = 8
"""Bit of `RatioImage.marks`: a pixel was not a finite number."""
HIDDEN, JUDGED = 16, 128
"""Bits of `RatioImage.marks`: the first of three bits for lights hidden by the present surface, and
the bit that shows that these are known. Otherwise a channel without light is dark."""
UNCHANGED = np.empty((0, 1, 1), np.float32)
"""`PyramidLevel.by_depth` without terms of the light."""


@dataclass(frozen=True, slots=True)
class GridRegion:
    """A rectangle of quarter-scale nodes: first row and column, and size."""

    corner: tuple[int, int]
    shape: tuple[int, int]

    def at(self, factor: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return corner and shape at a finer scale, `factor` nodes to a quarter-scale node."""
        (top, left), (rows, columns) = self.corner, self.shape
        return (factor * top, factor * left), (factor * rows, factor * columns)

    def window(self, factor: int) -> tuple[slice, slice]:
        """Return its slices of a grid at a finer scale, as :meth:`at`."""
        (top, left), (rows, columns) = self.at(factor)
        return np.s_[top : top + rows, left : left + columns]

    @property
    def nodes(self) -> int:
        """Quarter-scale nodes in it."""
        return self.shape[0] * self.shape[1]


class RatioImage(NamedTuple):
    """Press over background in a region of one scale.

    Attributes
    ----------
    ratio, noise : (3, rows, columns) float32
        Press over background, and its standard deviation.
    around : (12, rows, columns) float32
        The part that comes from other parts of the membrane: a constant (3), and the derivative of
        each channel by the normal (3 x 3). (12, 1, 1) where it gives no light to itself.
    marks : (rows, columns) uint8
        Bits 0 to 2: the channel is saturated; `NOT_FINITE`; `HIDDEN` and `JUDGED`.
    """

    ratio: Float32Array
    noise: Float32Array
    around: Float32Array
    marks: NDArray[np.uint8]


class PyramidLevel(NamedTuple):
    """What one scale of the solve reads of a sensor, for the whole grid.

    Attributes
    ----------
    factor : int
        Nodes of the calibration's grid to one node of this scale, along an axis.
    x_mm, y_mm : float
        First node, sensor frame.
    pitch_mm : float
        Distance between nodes.
    flat : (3, rows, columns) float32
        Brightness of the flat membrane under each light, times z / r^3.
    kind : (rows, columns) uint8
        2 usable, 1 inside but not usable, 0 outside.
    rays : (6, coarse rows, coarse columns) float32
        Ray slope by depth (x, y), and its derivatives along x (x, y) and along y (x, y).
    ray_step : float
        Nodes of `rays` to one node of this scale.
    rest : (3, rows, columns) float32 or None
        Height in mm of the undeformed membrane, and its slopes along x and y; None: flat.
    by_depth : (9, rows, columns) float32
        One over the factor of the terms of the light on each LED's light to the camera: a, b and c
        (3 each) of a + b d + c d^2 at a depth d along the rays. Empty without terms: for None, the
        loop would be compiled once more.
    """

    factor: int
    x_mm: float
    y_mm: float
    pitch_mm: float
    flat: Float32Array
    kind: NDArray[np.uint8]
    rays: Float32Array
    ray_step: float
    rest: Float32Array | None = None
    by_depth: Float32Array = UNCHANGED


class MembraneParameters(NamedTuple):
    """Membrane and lights as plain numbers in single precision.

    Attributes
    ----------
    leds : 3 x 3
        Positions, sensor frame, mm.
    dark : 3
        Brightness below which a channel is dark.
    curves : 3 x 8
        Polynomials of the diffuse share by the cosine, over pi, constant first.
    table : (3, nodes) float32 or None
        The same at even cosines, where no polynomial follows the curve.
    gloss : 2, or None
        Share and squared roughness of the glossy lobe.
    interreflection : float
        Reflectance for light from other parts of the membrane; 0: it gives none.
    coverage : 3 x 2
        Cosines of each light that the ball presses have shown.
    stretch_loss : float
        Loss of reflectance by the area that the coating gains.
    """

    leds: tuple[Triple, Triple, Triple]
    dark: Triple
    curves: tuple[tuple[float, ...], ...]
    table: Float32Array | None
    gloss: tuple[float, float] | None
    interreflection: float
    coverage: tuple[tuple[float, float], ...]
    stretch_loss: float = np.float32(0.0)  # type: ignore[assignment]


class GaussNewtonOptions(NamedTuple):
    """How far the normals are solved.

    Attributes
    ----------
    most : int
        Gauss-Newton steps at most.
    settled : float
        Square of the move below which a block of nodes is done.
    warm : bool
        Whether to start from the normals in `RegionSlopes`.
    """

    most: int
    settled: float
    warm: bool


class RegionSlopes(NamedTuple):
    """Slopes along the rays of a region, in the form for the integration, (rows, columns) each.

    Attributes
    ----------
    slope_x, slope_y : float32
        Change of the depth from node to node, per mm.
    weight : float32
        Weight of the slopes, 0..1.
    flags : uint8
        Bits of :class:`Flag`.
    normal_x, normal_y : float32
        x and y of the unit normal, z < 0.
    """

    slope_x: Float32Array
    slope_y: Float32Array
    weight: Float32Array
    flags: NDArray[np.uint8]
    normal_x: Float32Array
    normal_y: Float32Array


def slopes_like(depth_mm: Float32Array, take: Any = None) -> RegionSlopes:
    """Return arrays for the slopes of a region, lent by `take` if given."""
    types = [np.uint8 if name == "flags" else np.float32 for name in RegionSlopes._fields]
    if take is None:
        return RegionSlopes(*(np.empty(depth_mm.shape, kind) for kind in types))
    shape = depth_mm.shape
    return RegionSlopes(
        *(take(f, shape, kind) for f, kind in zip(RegionSlopes._fields, types, strict=True))
    )
