"""Standard deviations of measured sizes: noise, calibration, mode, and residual of the fit.

``noise`` is what repeats of the image scatter by: examples of the depth map's noise pass through
the fit's last step. The fit's weights move with the noise too, which that step does not show: where
the shape is not quite what was pressed, as at a cuboid's corners, widths scatter by two to three
times as much, about the whole at worst. ``calibration`` is common to all measurements with one
calibration, ``mode`` to all in one mode (model and effort). The fit's own standard deviation holds
the noise and whatever the shape does not explain (drape, edges, the ground's waves), with pixels
that err together counted once; the whole is the larger of it and the noise, together with
calibration and mode.

Depth errors of a share s at the walls also move the size: the drape's tail is still right and its
upper end is cut off at (1 - s) of the height, where ``h exp(-x / decay)`` has come down by s. The
wall seems to lie s * decay further out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.measurement.fit import FitResult, WindowData

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Spread = dict[str, Any]

BALL_SLOPE = 0.85
"""Steepest slope that ball presses show a calibration, 40 degrees. What is wrong with the membrane
there grows in proportion on steeper walls."""
LENGTHS = ("side_a_mm", "side_b_mm", "diameter_mm")


@dataclass(frozen=True, slots=True)
class ModeError:
    """What a model and effort leaves of a press even with an exact calibration.

    Attributes
    ----------
    depth : float
        Relative error of heights.
    depth_per_slope : float
        The same for each unit of the wall's slope, height over decay length.
    lateral_per_mm : float
        Relative error of lengths across, for each mm of depth.
    node_mm : float
        Distance between the nodes that were solved: wide ones round the upper end of walls.
    """

    depth: float
    depth_per_slope: float
    lateral_per_mm: float = 0.0
    node_mm: float = 0.0


WIDTH_BY_NODES = 0.7
"""Width that is added by rounding, times the drape's decay length over the square of `node_mm`: on
virtual and rendered sensors 26 to 52 um with nodes of 0.2 mm, 8 to 15 um with nodes of 0.1 mm."""
MODE_PITCH_MM = 0.025
MODE_ERRORS: Mapping[str, ModeError] = MappingProxyType(
    {
        "best": ModeError(0.0, 0.001),
        "balanced": ModeError(0.0, 0.0015),
        "fast": ModeError(0.0, 0.003),
        "paper": ModeError(0.03, 0.0),
    }
)
"""Chosen by hand to cover the errors of flat presses of 3 to 7 mm, 0.3 to 1.5 mm deep, into virtual
and rendered sensors, on grids of `MODE_PITCH_MM`: coarse nodes round the upper end of walls, with
the square of the pitch. The paper's model freezes its lights and leaves each point where its ray
meets the undeformed surface."""


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
    examples = noise_mm.reshape(len(noise_mm), -1)
    factor = round(x_mm.size / noise_mm.shape[2])

    def sums(pixels: Mask, shares: Array) -> Array:
        """Return for each example the sums of its values at pixels (P,), with shares (n, P)."""
        first = 0.5 * (factor - 1)
        column = (window.x_mm[pixels] - x_mm[0]) / (x_mm[1] - x_mm[0])
        row = (window.y_mm[pixels] - y_mm[0]) / (y_mm[1] - y_mm[0])
        nodes, weights = _bilinear((row - first) / factor, (column - first) / factor, noise_mm)
        size = examples.shape[1]
        spread = [
            np.bincount(nodes.ravel(), (weights * share).ravel(), minlength=size)
            for share in shares
        ]
        return np.asarray(examples @ np.array(spread).T, np.float64)

    moved = dict(zip(fit.values, sums(fit.chosen, fit.gain).T, strict=True))
    if face is not None and face.any():
        # A median scatters as the mean does where errors hang together over the whole face.
        mean = np.full((1, int(face.sum())), 1.0 / face.sum())
        moved["height_mm"] = sums(face, mean)[:, 0] - moved["offset_mm"]
    return {name: float(np.sqrt(np.mean(change**2))) for name, change in moved.items()}


def _bilinear(
    row: Array, column: Array, maps: NDArray[np.float32]
) -> tuple[NDArray[np.intp], Array]:
    """Return which four nodes (4, P) of a map make the value at each place, and their shares."""
    rows, columns = maps.shape[1:]
    row, column = np.clip(row, 0.0, rows - 1.0), np.clip(column, 0.0, columns - 1.0)
    above = np.minimum(row.astype(np.intp), max(rows - 2, 0))
    left = np.minimum(column.astype(np.intp), max(columns - 2, 0))
    down, right = row - above, column - left
    below, beside = np.minimum(above + 1, rows - 1), np.minimum(left + 1, columns - 1)
    nodes = [above * columns + left, above * columns + beside]
    nodes += [below * columns + left, below * columns + beside]
    weights = [(1.0 - down) * (1.0 - right), (1.0 - down) * right]
    weights += [down * (1.0 - right), down * right]
    return np.array(nodes), np.array(weights)


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
        Relative standard deviations of depths, on slopes that balls show, and of lengths across.
    """
    share = depth_scale_sd
    if shape != "ball":
        share *= max(_wall_slope(values) / BALL_SLOPE, 1.0)
    return _systematic(shape, values, share, lateral_scale_sd)


def mode_sd(shape: str, values: Mapping[str, float], mode: ModeError) -> dict[str, float]:
    """Return what the mode leaves open of the fit's parameters.

    Parameters
    ----------
    shape : str
        What was fitted.
    values : mapping
        The fit's parameters.
    mode : ModeError
        Of the height map.
    """
    share = math.hypot(mode.depth, mode.depth_per_slope * _wall_slope(values))
    found = _systematic(shape, values, share, mode.lateral_per_mm * abs(values["height_mm"]))
    rounded_mm = WIDTH_BY_NODES * mode.node_mm**2 / values["drape_decay_mm"]
    flat = [name for name in LENGTHS if name in found and shape != "ball"]
    return found | {name: math.hypot(found[name], rounded_mm) for name in flat}


def _wall_slope(values: Mapping[str, float]) -> float:
    return abs(values["height_mm"]) / values["drape_decay_mm"]


def _systematic(
    shape: str, values: Mapping[str, float], depth: float, lateral: float
) -> dict[str, float]:
    """Return standard deviations from relative ones of depths and of lengths across."""
    decay = values["drape_decay_mm"]
    found = {name: lateral * abs(values[name]) for name in ("x_mm", "y_mm")}
    found["height_mm"] = depth * abs(values["height_mm"])
    found["drape_decay_mm"] = math.hypot(lateral, depth) * decay
    if shape == "ball":
        # A ball's radius is a width squared over a depth.
        found["diameter_mm"] = math.hypot(2.0 * lateral, depth) * values["diameter_mm"]
        return found
    for name in LENGTHS:
        if name in values:
            found[name] = math.hypot(lateral * values[name], 2.0 * depth * decay)
    return found


def combined(
    fitted: Mapping[str, float], noise: Mapping[str, float], *systematic: Mapping[str, float]
) -> dict[str, float]:
    """Return the whole standard deviation of each parameter."""
    return {
        name: math.hypot(
            max(sd, noise.get(name, 0.0)), *(part.get(name, 0.0) for part in systematic)
        )
        for name, sd in fitted.items()
    }
