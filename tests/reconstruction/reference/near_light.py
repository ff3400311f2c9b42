"""Scalar oracle of the near-light solve, in double precision, one node after the other.

For every node the surface point is placed along its refracted ray at the present depth; light
directions, inverse square and lobe are those at that place. Press over background is compared with
the membrane's response, and the normal is found by Gauss-Newton steps on the unit sphere. A dark or
saturated channel is missing information: it is left out, and the two that remain decide together
with |n| = 1. Of their two solutions the one that keeps the dark light dark is started from.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import NDArray
from reference.near_light_kernel import solve_rows

from gelpolight_core.reflectance.membrane import Membrane

Map = NDArray[np.float32]
DARK_COSINE = 0.03


@dataclass(frozen=True, slots=True)
class ShadedField:
    """What one scale of the solve works on, all (rows, columns, ...) on one grid.

    Attributes
    ----------
    ratio, sigma, around : (rows, columns, 3) float32
        Press over background, its standard deviation, and the light from around in it.
    saturated : (rows, columns, 3) bool
        Channels that are saturated.
    usable : (rows, columns) bool
        Nodes with light and membrane.
    inside : (rows, columns) bool
        Nodes within the seen part of the working circle; where they are not usable, the depth is
        led by what is around.
    ray_slope : (rows, columns, 2) float32
        Sideways move of the ray per mm of depth.
    x_mm, y_mm : (columns,), (rows,) float64
        Nodes.
    """

    ratio: Map
    sigma: Map
    around: Map
    saturated: NDArray[np.bool_]
    usable: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    ray_slope: Map
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RaySlopes:
    """Slopes along the image's rays, as the ray-true integration wants them.

    Attributes
    ----------
    slope_x, slope_y : (rows, columns) float32
        Change of the depth from node to node, per mm.
    normals : (rows, columns, 3) float32
        Unit normals of the surface, z < 0.
    weight : (rows, columns) float32
        How far the slopes are to be trusted, 0..1.
    flags : (rows, columns) uint8
        Bits of :class:`Flag`.
    """

    slope_x: Map
    slope_y: Map
    normals: Map
    weight: Map
    flags: NDArray[np.uint8]


def solve_near_light(
    field: ShadedField,
    depth_mm: Map,
    led_positions_mm: NDArray[np.float64],
    membrane: Membrane,
    *,
    shadows: bool = True,
    workers: int = 1,
) -> RaySlopes:
    """Solve every node's normal at the present depth.

    Parameters
    ----------
    field : ShadedField
        The image on the grid.
    depth_mm : (rows, columns) float32
        Present depth at each node's ray.
    led_positions_mm : (3, 3)
        Sensor frame.
    membrane : Membrane
        Its response.
    shadows : bool, optional
        Whether a dark channel is missing information; else its value is believed.
    workers : int, optional
        Threads; each takes a block of rows, so that the result does not depend on their number.
    """
    shape = depth_mm.shape
    slope_x, slope_y, weight = (np.zeros(shape, np.float32) for _ in range(3))
    normals = np.zeros((*shape, 3), np.float32)
    flags = np.zeros(shape, np.uint8)
    shape_of = np.array(
        [membrane.exponent, membrane.gloss, membrane.roughness, membrane.interreflection],
        np.float64,
    )
    curves = membrane.curves if membrane.diffuse else None
    dark = np.ascontiguousarray(dark_brightness(membrane))
    depth = np.ascontiguousarray(depth_mm, np.float32)
    leds = np.ascontiguousarray(led_positions_mm, np.float64)

    def solve(rows: tuple[int, int]) -> None:
        solve_rows(
            rows[0],
            rows[1],
            field.ratio,
            field.sigma,
            field.around,
            field.saturated,
            field.usable,
            field.inside,
            field.ray_slope,
            field.x_mm,
            field.y_mm,
            depth,
            leds,
            shape_of,
            curves,
            dark,
            shadows,
            slope_x,
            slope_y,
            normals,
            weight,
            flags,
        )

    # More blocks than threads: rows without contact are done sooner.
    edges = np.linspace(0, shape[0], 8 * max(workers, 1) + 1).astype(int).tolist()
    with ThreadPoolExecutor(max(workers, 1)) as pool:
        list(pool.map(solve, pairwise(edges)))
    return RaySlopes(slope_x, slope_y, normals, weight, flags)


def dark_brightness(membrane: Membrane) -> NDArray[np.float64]:
    """Return the brightness (3,) below which a channel counts as dark whatever its noise."""
    if not membrane.diffuse:
        return np.full(3, DARK_COSINE * (1.0 - membrane.gloss) / pi)
    share = membrane.diffuse_share(np.full(3, DARK_COSINE))
    return np.asarray((1.0 - membrane.gloss) * share / pi)
