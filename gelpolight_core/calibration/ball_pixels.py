"""Pixels of the ball presses for the joint refinement: press over background, and camera rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.masks import SATURATED
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import LEAST_VALUE, BallPress
from gelpolight_core.reflectance.surroundings import neighbourhood, view_directions

Array = NDArray[np.float64]
Map = NDArray[np.float32]
BOUNCE_REACH_MM = 1.0
DRAPE_WIDTH_MM = 1.6
EDGE_GAP_MM = 0.12
PIXELS_PER_PART = 800
# Light that a convex cap receives from its surroundings comes from further away and is modelled
# less well.
CAP_TRUST = 0.3
MODEL_ERROR = 0.01


@dataclass(frozen=True, slots=True)
class BallPixels:
    """Pixels of one press on the ball's cap and on the drape around it.

    Attributes
    ----------
    points_mm, ray_slope, view : (N, 2), (N, 2), (N, 3)
        Camera rays (point and ray slope), and unit directions back to the camera.
    ratio, weight, around : (N, 3)
        Press over background, 1 / its standard deviation, and its average in the neighbourhood.
    radius_mm : float
        Radius of the ball.
    """

    points_mm: Array
    ray_slope: Array
    view: Array
    ratio: Array
    weight: Array
    around: Array
    radius_mm: float


def gather_ball_pixels(
    press: BallPress,
    image: Map,
    background: Map,
    table: ResamplingTable,
    usable: NDArray[np.bool_],
    noise: Array,
) -> BallPixels:
    """Choose pixels on a ball's cap and on the drape around it.

    Parameters
    ----------
    press : BallPress
        The detected ball.
    image, background : (rows, columns, 3) float32
        Resampled, crosstalk removed.
    table : ResamplingTable
        The grid and its rays.
    usable : (rows, columns) bool
        Nodes with light and membrane.
    noise : (3,)
        Standard deviation of press minus background.
    """
    grid = table.grid
    base = np.maximum(background, LEAST_VALUE)
    ratio = np.asarray(image / base, np.float32)
    around = neighbourhood(ratio, usable, grid.pitch_mm, BOUNCE_REACH_MM)
    column, row = np.round(grid.to_index(np.asarray(press.pose.centre_mm))).astype(int)
    centre = press.seen_centre_mm(table.ray_slope[row, column].astype(np.float64))
    away = np.hypot(grid.x_mm[None, :] - centre[0], grid.y_mm[:, None] - centre[1])
    contact = press.contact_radius_mm
    random = np.random.default_rng(0)
    parts = (
        (CAP_TRUST, 0.0, 0.9 * contact),
        (1.0, contact + EDGE_GAP_MM, contact + DRAPE_WIDTH_MM),
    )
    chosen, trust = [], []
    for part, low, high in parts:
        indices = np.flatnonzero((usable & (away >= low) & (away < high)).ravel())
        chosen.append(random.permutation(indices)[:PIXELS_PER_PART])
        trust.append(np.full((chosen[-1].size, 1), part))
    rows, columns = np.unravel_index(np.concatenate(chosen), away.shape)
    value = image[rows, columns].astype(np.float64)
    below = base[rows, columns].astype(np.float64)
    known = (value > LEAST_VALUE) & (value < SATURATED) & (background[rows, columns] > LEAST_VALUE)
    sd = np.hypot(np.hypot(noise / np.sqrt(2.0), MODEL_ERROR * value) / below, MODEL_ERROR)
    ray_slope = table.ray_slope[rows, columns].astype(np.float64)
    return BallPixels(
        np.stack([grid.x_mm[columns], grid.y_mm[rows]], axis=-1),
        ray_slope,
        view_directions(ray_slope),
        value / below,
        np.where(known, np.concatenate(trust) / sd, 0.0),
        around[rows, columns].astype(np.float64),
        press.pose.radius_mm,
    )


def thinned(pixels: BallPixels) -> BallPixels:
    """Return every second pixel of a press."""

    def half(part: Array) -> Array:
        return np.ascontiguousarray(part[::2])

    return BallPixels(
        half(pixels.points_mm),
        half(pixels.ray_slope),
        half(pixels.view),
        half(pixels.ratio),
        half(pixels.weight),
        half(pixels.around),
        pixels.radius_mm,
    )
