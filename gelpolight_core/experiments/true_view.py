"""Which points of a surface with known depth the camera and the LEDs reach."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.measurement.score import TrueDepth

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
LEVELS, HALVINGS = 60, 16
SHADOW_STEPS = 50
CLEAR_MM = 0.004
"""A surface that rises less above a light ray casts no shadow, because the truth is
interpolated."""


class TrueView(NamedTuple):
    """The true surface at the rays of a grid.

    Attributes
    ----------
    depth_mm : (rows, columns)
        Where each ray meets the surface.
    points_mm, normals : (rows, columns, 3)
        Sensor frame; unit normals, z < 0.
    known : (rows, columns) bool
        Whether the truth is known there.
    """

    depth_mm: Array
    points_mm: Array
    normals: Array
    known: Mask


def true_view(truth: TrueDepth, x_mm: Array, y_mm: Array, ray_slope: Array) -> TrueView:
    """Return where rays meet a true surface first.

    Parameters
    ----------
    truth : TrueDepth
        The surface.
    x_mm, y_mm : (columns,), (rows,)
        Intersections of the rays with the flat membrane.
    ray_slope : (rows, columns, 2)
        Their lateral displacement per mm of depth.
    """
    x, y = np.meshgrid(x_mm, y_mm)

    def above(depth: Array) -> Mask:
        """Return whether the surface reaches the rays at a depth."""
        there = _at(
            truth, truth.depth_mm, x + depth * ray_slope[..., 0], y + depth * ray_slope[..., 1]
        )
        return np.asarray(there >= depth)

    step = 1.02 * float(truth.depth_mm.max()) / LEVELS
    low = np.zeros(x.shape)
    met = np.zeros(x.shape, bool)
    for level in range(LEVELS, -1, -1):
        new = above(np.full(x.shape, level * step)) & ~met
        low[new] = level * step
        met |= new
    high = low + step
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        reached = above(middle)
        low, high = np.where(reached, middle, low), np.where(reached, high, middle)
    px, py = x + low * ray_slope[..., 0], y + low * ray_slope[..., 1]
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    gradients = [np.asarray(np.gradient(truth.depth_mm, pitch, axis=axis)) for axis in (1, 0)]
    slopes = [_at(truth, gradient, px, py) for gradient in gradients]
    normals = np.stack([-slopes[0], -slopes[1], -np.ones_like(px)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    known = (px > truth.x_mm[0]) & (px < truth.x_mm[-1])
    known &= (py > truth.y_mm[0]) & (py < truth.y_mm[-1])
    return TrueView(low, np.stack([px, py, -low], axis=-1), normals, known)


def lit_by(truth: TrueDepth, view: TrueView, leds_mm: Array) -> Mask:
    """Return which LEDs (rows, columns, 3) light each point: it faces them without an obstacle.

    Parameters
    ----------
    truth, view
        The surface and its points.
    leds_mm : (3, 3)
        Sensor frame.
    """
    deepest = 1.001 * float(truth.depth_mm.max())
    lit = np.empty(view.points_mm.shape, bool)
    for k in range(3):
        to_led = leds_mm[k] - view.points_mm
        lit[..., k] = np.einsum("ijc,ijc->ij", to_led, view.normals) > 0.0
        # The ray is clear when it is deeper than the deepest point of the surface.
        share = np.maximum(deepest - view.depth_mm, 0.0) / -to_led[..., 2]
        for i in range(1, SHADOW_STEPS + 1):
            at = (share * (i / SHADOW_STEPS) ** 1.5)[..., None] * to_led + view.points_mm
            surface = _at(truth, truth.depth_mm, at[..., 0], at[..., 1])
            lit[..., k] &= surface <= -at[..., 2] + CLEAR_MM
    return lit


def _at(truth: TrueDepth, values: Array, x: Array, y: Array) -> Array:
    """Return values of the truth's grid at positions, 0 outside it."""
    pitch = float(truth.x_mm[1] - truth.x_mm[0])
    index = [(y - truth.y_mm[0]) / pitch, (x - truth.x_mm[0]) / pitch]
    return np.asarray(map_coordinates(values, index, order=1, mode="constant"))
