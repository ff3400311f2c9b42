"""Directions and distances of the LEDs at points of the membrane."""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.geometry.resampling import ResamplingTable

LEAST_COSINE = 1e-3
"""Least cosine on a curved membrane, which may face away from a light."""


def light_directions(
    led_positions_mm: Float64Array, points_mm: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return unit directions to the LEDs and distances.

    Parameters
    ----------
    led_positions_mm : (3, 3)
        LED positions, sensor frame.
    points_mm : (..., 3)
        Surface points, sensor frame.

    Returns
    -------
    directions : (..., 3, 3)
        ``directions[..., k, :]`` points to LED k.
    distances_mm : (..., 3)
        Distances to each LED.
    """
    towards = led_positions_mm - np.asarray(points_mm)[..., None, :]
    distances = np.sqrt(np.einsum("...c,...c->...", towards, towards))
    return towards / distances[..., None], distances


def flat_cosines(table: ResamplingTable, led_positions_mm: Float64Array) -> Float64Array:
    """Return cos(theta_k) (rows, columns, 3) on the undeformed membrane.

    Parameters
    ----------
    table : ResamplingTable
        Table with the membrane grid.
    led_positions_mm : (3, 3)
        LED positions, sensor frame.
    """
    if not table.surface.flat:
        points = table.grid.points_mm()
        light, _ = light_directions(led_positions_mm, table.surface.points(points))
        facing = np.einsum("...kc,...c->...k", light, table.surface.normals(points))
        return np.asarray(np.maximum(facing, LEAST_COSINE))
    columns, rows = table.grid.x_mm, table.grid.y_mm
    lateral2 = [np.add.outer((rows - y) ** 2, (columns - x) ** 2) for x, y, _ in led_positions_mm]
    height = led_positions_mm[:, 2]
    return np.asarray(-height / np.sqrt(np.stack(lateral2, axis=-1) + height**2))


def direction_condition(led_positions_mm: Float64Array, points_mm: Float64Array) -> float:
    """Return the largest condition number of the light directions at points (..., 2).

    Parameters
    ----------
    led_positions_mm : (3, 3)
        LED positions, sensor frame.
    points_mm : (..., 2)
        Points (x, y) of the flat membrane.
    """
    points = np.asarray(points_mm, dtype=np.float64)
    at_top = np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)
    directions, _ = light_directions(led_positions_mm, at_top)
    return float(np.max(np.linalg.cond(directions)))
