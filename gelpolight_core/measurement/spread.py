"""Standard deviations of measured sizes: noise, calibration, and what the fit leaves over.

``noise`` is what repeats of the picture scatter by: examples of the depth map's noise pass through
the fit's last step. The fit's weights move with the noise too, which that step does not show: where
the shape is not quite what was pressed, as at a cuboid's corners, widths scatter by two to three
times as much, about the whole at worst. ``calibration`` is common to all measurements with one
calibration. The fit's own standard deviation holds the noise and whatever the shape does not
explain (drape, edges, the ground's waves), with pixels that err together counted once; the whole is
the larger of it and the noise, together with the calibration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.measurement.fit import FitResult, WindowData

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Spread = dict[str, Any]


def noise_of_fit(
    fit: FitResult,
    window: WindowData,
    face: Mask | None,
    noise_mm: NDArray[np.float32],
    x_mm: Array,
    y_mm: Array,
) -> dict[str, float]:
    """Return the standard deviation of the fit's parameters from a map's noise.

    Parameters
    ----------
    fit : FitResult
        The fit.
    window : WindowData
        What it was fitted to.
    face : (rows, columns) bool or None
        The window's pixels whose median the height is taken from, where it is.
    noise_mm : (examples, map rows / factor, map columns / factor)
        Examples of the map's noise, averages over blocks of pixels.
    x_mm, y_mm : (map columns,), (map rows,)
        The map's grid.
    """

    def at(pixels: Mask) -> Array:
        factor = round(x_mm.size / noise_mm.shape[2])
        first = 0.5 * (factor - 1)
        column = (window.x_mm[pixels] - x_mm[0]) / (x_mm[1] - x_mm[0])
        row = (window.y_mm[pixels] - y_mm[0]) / (y_mm[1] - y_mm[0])
        place = np.stack([row - first, column - first]) / factor
        return np.array([map_coordinates(e, place, order=1, mode="nearest") for e in noise_mm])

    moved = dict(zip(fit.values, (at(fit.chosen) @ fit.gain.T).T, strict=True))
    if face is not None and face.any():
        # A median scatters as the mean does where errors hang together over the whole face.
        moved["height_mm"] = at(face).mean(axis=1) - moved["offset_mm"]
    return {name: float(np.sqrt(np.mean(change**2))) for name, change in moved.items()}


def calibration_sd(
    shape: str, values: Mapping[str, float], depth_scale_sd: float, lateral_scale_sd: float
) -> dict[str, float]:
    """Return what the calibration leaves open of the fit's parameters.

    Parameters
    ----------
    shape : str
        What was fitted.
    values : mapping
        The fit's parameters.
    depth_scale_sd, lateral_scale_sd : float
        Relative standard deviations of depths and of lengths across.
    """
    found = {
        name: lateral_scale_sd * abs(value)
        for name, value in values.items()
        if name in ("x_mm", "y_mm", "side_a_mm", "side_b_mm", "diameter_mm", "drape_decay_mm")
    }
    if shape == "ball":
        # A ball's radius is a width squared over a depth.
        share = math.hypot(2.0 * lateral_scale_sd, depth_scale_sd)
        found["diameter_mm"] = share * values["diameter_mm"]
    found["height_mm"] = depth_scale_sd * values["height_mm"]
    return found


def combined(
    fitted: Mapping[str, float], noise: Mapping[str, float], calibration: Mapping[str, float]
) -> dict[str, float]:
    """Return the whole standard deviation of each parameter."""
    return {
        name: math.hypot(max(sd, noise.get(name, 0.0)), calibration.get(name, 0.0))
        for name, sd in fitted.items()
    }
