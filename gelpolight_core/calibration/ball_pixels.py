"""Pixels of the ball presses for the joint refinement: press over background, and the rays."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import LEAST_VALUE, SATURATED, BallPress

Array = NDArray[np.float64]
Map = NDArray[np.float32]
BOUNCE_REACH_MM = 1.0
DRAPE_WIDTH_MM = 1.6
EDGE_GAP_MM = 0.12
PIXELS_PER_PART = 800
# What a convex cap receives from its surroundings lies further off and is modelled less well.
CAP_TRUST = 0.3
MODEL_ERROR = 0.01


@dataclass(frozen=True, slots=True)
class BallPixels:
    """Pixels of one press on the ball's cap and on the drape around it.

    Attributes
    ----------
    points_mm, drift, view : (N, 2), (N, 2), (N, 3)
        Rays, and unit directions back to the camera.
    ratio, weight, around : (N, 3)
        Press over background, 1 / its standard deviation, and its average in the neighbourhood.
    radius_mm : float
        Of the ball.
    """

    points_mm: Array
    drift: Array
    view: Array
    ratio: Array
    weight: Array
    around: Array
    radius_mm: float


def view_directions(drift: Array) -> Array:
    """Return unit directions (..., 3) back along the rays, from their drift (..., 2)."""
    view = np.concatenate([drift, -np.ones_like(drift[..., :1])], axis=-1)
    return np.asarray(view / np.linalg.norm(view, axis=-1, keepdims=True))


def neighbourhood(ratio: Map, valid: NDArray[np.bool_], pitch_mm: float, reach_mm: float) -> Map:
    """Return press over background, averaged over a Gaussian; 1 where it is not known."""
    known = np.clip(np.where(valid[..., None], ratio, 1.0), 0.0, 4.0).astype(np.float32)
    factor = max(int(reach_mm / pitch_mm / 4.0), 1)
    rows, columns = valid.shape
    small = cv2.resize(known, (columns // factor, rows // factor), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), reach_mm / pitch_mm / factor)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR))


def gather_ball_pixels(
    press: BallPress,
    picture: Map,
    background: Map,
    table: ResamplingTable,
    usable: NDArray[np.bool_],
    noise: Array,
) -> BallPixels:
    """Choose pixels on a ball's cap and on the drape around it.

    Parameters
    ----------
    press : BallPress
        The ball as found.
    picture, background : (rows, columns, 3) float32
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
    ratio = np.asarray(picture / base, np.float32)
    around = neighbourhood(ratio, usable, grid.pitch_mm, BOUNCE_REACH_MM)
    column, row = np.round(grid.to_index(np.asarray(press.pose.centre_mm))).astype(int)
    centre = press.seen_centre_mm(table.drift[row, column].astype(np.float64))
    away = np.hypot(grid.x_mm[None, :] - centre[0], grid.y_mm[:, None] - centre[1])
    contact = press.contact_radius_mm
    random = np.random.default_rng(0)
    parts = (
        (CAP_TRUST, 0.0, 0.9 * contact),
        (1.0, contact + EDGE_GAP_MM, contact + DRAPE_WIDTH_MM),
    )
    chosen, trust = [], []
    for part, low, high in parts:
        places = np.flatnonzero((usable & (away >= low) & (away < high)).ravel())
        chosen.append(random.permutation(places)[:PIXELS_PER_PART])
        trust.append(np.full((chosen[-1].size, 1), part))
    rows, columns = np.unravel_index(np.concatenate(chosen), away.shape)
    value = picture[rows, columns].astype(np.float64)
    below = base[rows, columns].astype(np.float64)
    known = (value > LEAST_VALUE) & (value < SATURATED) & (background[rows, columns] > LEAST_VALUE)
    sd = np.hypot(np.hypot(noise / np.sqrt(2.0), MODEL_ERROR * value) / below, MODEL_ERROR)
    drift = table.drift[rows, columns].astype(np.float64)
    return BallPixels(
        np.stack([grid.x_mm[columns], grid.y_mm[rows]], axis=-1),
        drift,
        view_directions(drift),
        value / below,
        np.where(known, np.concatenate(trust) / sd, 0.0),
        around[rows, columns].astype(np.float64),
        press.pose.radius_mm,
    )


def thinned(pixels: BallPixels) -> BallPixels:
    """Return every second pixel of a press."""
    return BallPixels(
        pixels.points_mm[::2],
        pixels.drift[::2],
        pixels.view[::2],
        pixels.ratio[::2],
        pixels.weight[::2],
        pixels.around[::2],
        pixels.radius_mm,
    )
