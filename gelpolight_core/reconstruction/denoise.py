"""Quiet the even parts of a picture and leave its edges alone.

A normal is not a linear function of the picture: near an LED's mirror image a channel hardly
changes with the slope, and noise there tilts the surface to one side instead of both. Averaging a
few pixels before the solve takes that away; on walls and edges, where averaging would cost
sharpness and the signal is strong, the picture is used as it is.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]
QUIET_PX = 1.2
WIDE_PX = 2.4
SIGNIFICANT = 4.0


def quiet_even_parts(light: Map, usable: NDArray[np.bool_]) -> Map:
    """Return the picture with its even parts averaged over a few nodes.

    Parameters
    ----------
    light : (rows, columns, 3) float32
        Linear light.
    usable : (rows, columns) bool
        Nodes with light and membrane; the noise is measured there.
    """
    if not usable.any():
        return light
    quiet = np.asarray(cv2.GaussianBlur(light, (0, 0), QUIET_PX), np.float32)
    edge = _edges(light, quiet, usable)
    return np.asarray(quiet + edge[..., None] * (light - quiet), np.float32)


def noise_left(
    light: Map, usable: NDArray[np.bool_], pixels_per_node: Map, *, resampled: int = 1
) -> Map:
    """Return the share (rows, columns) of a raw pixel's noise that a quieted node still has.

    Bilinear resampling (a tent of variance 1/6 pixel^2 per axis) and the average over `QUIET_PX`
    are taken together as Gaussians. Where the picture is left as it is, the tents alone count:
    averaged over where a node falls between the pixels, one leaves 2/3 of the variance per axis,
    two together (a cubic B-spline) leave 151/315.

    Parameters
    ----------
    light, usable
        As for :func:`quiet_even_parts`.
    pixels_per_node : (rows, columns) float32
        Raw pixels in the area of one node.
    resampled : int, optional
        How many times, 1 or 2.
    """
    if not usable.any():
        return np.ones(usable.shape, np.float32)
    quiet = np.asarray(cv2.GaussianBlur(light, (0, 0), QUIET_PX), np.float32)
    edge = _edges(light, quiet, usable)
    tent = resampled / (3.0 * pixels_per_node)
    bare = {1: 2.0 / 3.0, 2: 151.0 / 315.0}[resampled] ** 2

    def shared(average_px2: float) -> Map:
        return np.asarray(1.0 / (2.0 * np.pi * pixels_per_node * (average_px2 + tent)))

    even = 1.0 - edge
    variance = even**2 * shared(2.0 * QUIET_PX**2) + edge**2 * bare
    variance += 2.0 * even * edge * shared(QUIET_PX**2)
    return np.sqrt(variance).astype(np.float32)


def _edges(light: Map, quiet: Map, usable: NDArray[np.bool_]) -> Map:
    """Return how far (rows, columns) the picture is to be left as it is, 0..1."""
    wide = np.asarray(cv2.GaussianBlur(light, (0, 0), WIDE_PX))
    seen = light[usable]
    level = np.median(seen, axis=0)
    noise = 1.4826 * np.median(np.abs(seen - quiet[usable]), axis=0) + 1e-6
    # Shot noise grows as the root of the light.
    local = noise * np.sqrt(np.maximum(quiet / np.maximum(level, 1e-6), 0.2))
    # White noise of sd 1 leaves this much between the two averages.
    left = np.sqrt(1.0 / QUIET_PX**2 + 1.0 / WIDE_PX**2 - 4.0 / (QUIET_PX**2 + WIDE_PX**2))
    limit = SIGNIFICANT * local * left / np.sqrt(4.0 * np.pi)
    excess = (np.abs(quiet - wide) / limit).max(axis=2) - 1.0
    edge = np.clip(excess, 0.0, 1.0).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(cv2.dilate(edge, np.ones((5, 5), np.uint8)), (0, 0), 1.5))
