"""Areal roughness of a region: Sa, Sq and Sz of ISO 25178-2."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.measurement.area import Rectangle, nodes_inside
from gelpolight_core.measurement.measured import Measured, map_errors, measured
from gelpolight_core.reconstruction.height_map import HeightMap

Array = NDArray[np.float64]
Levelled = Literal["plane", "none"]
UM = 1e3
ERROR_NODES = 2000
"""Nodes at which errors are propagated. More nodes give the same result and take more time."""


@dataclass(frozen=True, slots=True)
class Roughness:
    """Height parameters of a region.

    Attributes
    ----------
    sa_um, sq_um, sz_um : float
        Arithmetic mean and root mean square of the height about the mean plane; highest peak plus
        deepest pit.
    count : int
        Nodes in the region.
    levelled : str
        ``plane``: the least-squares plane was taken off; ``none``: only the mean height.
    sd_um : (float, float, float) or None
        Standard deviations of Sa, Sq and Sz; None where the height map states none.
    noise_sq_um : float or None
        The Sq of a smooth surface by the map's errors alone. A measured Sq near this value contains
        no information on the surface.
    """

    sa_um: float
    sq_um: float
    sz_um: float
    count: int
    levelled: Levelled
    sd_um: tuple[float, float, float] | None = None
    noise_sq_um: float | None = None

    @property
    def figures(self) -> tuple[Measured, Measured, Measured]:
        """Sa, Sq and Sz as measured values."""
        sd = self.sd_um or (None, None, None)
        return (
            Measured(self.sa_um, sd[0], "um", "sa"),
            Measured(self.sq_um, sd[1], "um", "sq"),
            Measured(self.sz_um, sd[2], "um", "sz"),
        )


def roughness(
    heightmap: HeightMap, rectangle: Rectangle, *, levelled: Levelled = "plane"
) -> Roughness:
    """Return the roughness of a region.

    All nodes have the same weight. Only the plane is subtracted, without an S-filter or an
    L-filter: the resolution of the camera replaces the S-filter, and waviness within the region is
    included.

    Parameters
    ----------
    heightmap : HeightMap
        The surface.
    rectangle : Rectangle
        The region.
    levelled : {"plane", "none"}, optional
        What is subtracted first.

    Raises
    ------
    InputError
        If the region contains too few nodes.

    References
    ----------
    ISO 25178-2:2021, height parameters: Sa (arithmetical mean height), Sq (root mean square
    height), Sz (maximum height: maximum peak height plus maximum pit depth).
    """
    nodes = nodes_inside(heightmap, rectangle)
    left = _levelled(nodes.x_mm, nodes.y_mm, nodes.depth_mm, levelled)
    found = Roughness(_sa(left), _sq(left), _sz(left), left.size, levelled)
    few = nodes.thinned(ERROR_NODES)
    errors = map_errors(heightmap, few.x_mm, few.y_mm)
    if errors is None:
        return found

    def sd(height_parameter: Callable[[Array], float]) -> float:
        def compute(depth: Array, stretch: float) -> float:
            return height_parameter(_levelled(few.x_mm, few.y_mm, depth, levelled))

        return measured("", "um", compute, few.depth_mm, errors).sd or 0.0

    alone = [_levelled(few.x_mm, few.y_mm, error, levelled) for error in errors.depth_mm]
    noise = math.sqrt(float(np.mean([_sq(error) ** 2 for error in alone])))
    return replace(found, sd_um=(sd(_sa), sd(_sq), sd(_sz)), noise_sq_um=noise)


def fit_plane(x_mm: Array, y_mm: Array, depth_mm: Array) -> tuple[float, float, float]:
    """Return the least-squares plane: its depth at the mean place, and its slopes along x and y."""
    x, y = x_mm - x_mm.mean(), y_mm - y_mm.mean()
    terms = np.stack([np.ones_like(x), x, y], axis=1)
    level, slope_x, slope_y = np.linalg.lstsq(terms, depth_mm)[0].tolist()
    return level, slope_x, slope_y


def _levelled(x_mm: Array, y_mm: Array, depth_mm: Array, how: Levelled) -> Array:
    if how == "none":
        return np.asarray(depth_mm - depth_mm.mean())
    level, slope_x, slope_y = fit_plane(x_mm, y_mm, depth_mm)
    plane = level + slope_x * (x_mm - x_mm.mean()) + slope_y * (y_mm - y_mm.mean())
    return np.asarray(depth_mm - plane)


def _sa(height_mm: Array) -> float:
    return UM * float(np.mean(np.abs(height_mm)))


def _sq(height_mm: Array) -> float:
    return UM * math.sqrt(float(np.mean(height_mm**2)))


def _sz(height_mm: Array) -> float:
    return UM * float(np.ptp(height_mm))
