"""The slopes of a pressed ball, its position from slopes, and the place of the next ball."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid

STEEPEST_ROOT = 0.2
"""Least distance of the ball's surface from its equator, in radii: its slope ends there."""
AROUND = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
"""Directions over which slopes towards the centre are averaged."""
DECAYS = (0.08, 0.15, 0.25, 0.4, 0.6, 0.9)
"""Tested decay lengths of the membrane around the contact, in contact radii."""


@dataclass(frozen=True, slots=True)
class BallContact:
    """A ball in an image, with lengths in nodes of the working grid.

    Attributes
    ----------
    x, y : float
        Middle of the contact.
    contact : float
        Radius of the contact.
    radius : float
        Radius of the ball.
    rest : MembraneShape
        The undeformed membrane.
    """

    x: float
    y: float
    contact: float
    radius: float
    rest: MembraneShape = FLAT

    def slopes(self, x: Float64Array, y: Float64Array) -> Float64Array:
        """Return the depth's slopes (..., 2) on the ball at positions (...) from the contact.

        The contact is a circle around the membrane's normal at its middle, on which the ball's
        centre lies. On a flat membrane they are -(x, y) / sqrt(R^2 - rho^2).
        """
        contact_middle = np.array([self.x, self.y])
        positions = np.stack([x, y], axis=-1)
        slope = self.rest.slopes(contact_middle)
        to_ring = np.sqrt((self.radius**2 - self.contact**2) / (1.0 + slope @ slope))
        from_ball = positions + to_ring * slope
        square = self.radius**2 - (from_ball**2).sum(axis=-1, keepdims=True)
        root = np.sqrt(np.maximum(square, (STEEPEST_ROOT * self.radius) ** 2))
        return np.asarray(self.rest.slopes(positions + contact_middle) - from_ball / root)

    def inward(self, radius: Float64Array) -> Float64Array:
        """Return the depth's mean slopes (N,) towards the centre at distances (N,) from it."""
        directions = np.stack([np.cos(AROUND), np.sin(AROUND)], axis=-1)
        slopes = self.slopes(*np.moveaxis(radius[:, None, None] * directions, -1, 0))
        return np.asarray(-(slopes * directions).sum(axis=-1).mean(axis=-1))

    def limited(self) -> BallContact:
        """Return the ball with its contact limited by its radius."""
        # With a contact radius nearer to the ball's, the slope is too large.
        return replace(self, contact=min(self.contact, 0.95 * self.radius))


def offsets_from_centre(
    shape: tuple[int, int], ball: BallContact
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Return x, y and distance (rows, columns) from a ball's centre."""
    x = np.arange(shape[1], dtype=np.float32)[None, :] - np.float32(ball.x)
    y = np.arange(shape[0], dtype=np.float32)[:, None] - np.float32(ball.y)
    x, y = np.broadcast_arrays(x, y)
    return x, y, np.hypot(x, y)


def refine_centre_by_slopes(
    slope_x: Float32Array, slope_y: Float32Array, ball: BallContact
) -> BallContact:
    """Return the ball with the centre that follows from the slopes inside the contact."""
    x, y = ball.x, ball.y
    # The slopes near the edge do not determine the centre.
    reach = 0.85 * ball.contact
    for _ in range(4):
        placed = replace(ball, x=x, y=y)
        from_x, from_y, rho = offsets_from_centre(slope_x.shape, placed)
        inside = rho < reach
        if np.count_nonzero(inside) < 12:
            break
        dx, dy = (np.asarray(a[inside], np.float64) for a in (from_x, from_y))
        expected = placed.slopes(dx, dy)
        residual = np.stack([slope_x[inside], slope_y[inside]], axis=-1) - expected
        # Moving the centre by c changes the slopes by about c / root.
        gain = 1.0 / np.sqrt(np.maximum(ball.radius**2 - dx**2 - dy**2, 1.0))[:, None]
        # Slopes that differ by more than 0.15 have decreasing weight.
        weight = gain / (1.0 + (residual / 0.15) ** 2)
        step = (weight * residual).sum(axis=0) / (weight * gain).sum(axis=0)
        step = np.clip(step, -0.2 * ball.contact, 0.2 * ball.contact)
        x, y = x + float(step[0]), y + float(step[1])
    return replace(ball, x=x, y=y)


def contact_radius_by_slopes(
    slope_x: Float32Array, slope_y: Float32Array, ball: BallContact, *, smoothing: float
) -> float:
    """Return the contact's radius, up to which the membrane has the slope of the ball.

    The mean slope towards the centre is compared with that of the ball inside the contact and an
    exponential decay outside, both smoothed like the image.

    Parameters
    ----------
    slope_x, slope_y : (rows, columns)
        Measured slopes.
    ball : BallContact
        Approximate position and contact.
    smoothing : float
        Standard deviation of the image's smoothing, nodes.
    """
    from_x, from_y, rho = offsets_from_centre(slope_x.shape, ball)
    inward = -(slope_x * from_x + slope_y * from_y) / np.maximum(rho, 1e-6)
    in_reach = rho < 2.0 * ball.contact
    ring = rho[in_reach].astype(np.intp)
    order = np.argsort(ring, kind="stable")
    edges = np.searchsorted(ring[order], np.arange(ring.max(initial=0) + 2))
    values = inward[in_reach][order]
    count = np.diff(edges)
    profile = np.array(
        [np.median(values[a:b]) if b - a > 5 else np.nan for a, b in pairwise(edges)]
    )
    radius = np.arange(len(profile)) + 0.5
    valid = np.isfinite(profile) & (radius > 0.4 * ball.contact)
    if np.count_nonzero(valid) < 8:
        return ball.contact
    table, contacts = _profiles(ball, radius[valid], smoothing)
    weight = np.sqrt(count[valid])
    cost = (weight * np.minimum(np.abs(table - profile[valid]), 0.3)).sum(axis=-1)
    return float(contacts[int(cost.min(axis=1).argmin())])


def _profiles(
    ball: BallContact, radius: Float64Array, smoothing: float
) -> tuple[Float64Array, Float64Array]:
    """Return the slopes (contacts, decays, radii) of the tested contacts, and the contacts."""
    max_contact = min(1.35 * ball.contact, 0.97 * ball.radius)
    contacts = np.arange(0.6 * ball.contact, max_contact, 0.5)
    step = 0.5
    fine = np.arange(0.0, radius[-1] + 4.0 * smoothing, step)
    on_ball = ball.inward(fine)
    edge = ball.inward(contacts)[:, None, None]
    outside = (fine - contacts[:, None])[:, None] / (
        np.array(DECAYS)[:, None] * contacts[:, None, None]
    )
    slopes = np.where(outside < 0.0, on_ball, edge * np.exp(-np.maximum(outside, 0.0)))
    flat = slopes.reshape(-1, len(fine)).astype(np.float32)
    smooth = cv2.GaussianBlur(
        flat, (0, 0), sigmaX=smoothing / step, sigmaY=1e-6, borderType=cv2.BORDER_REPLICATE
    )
    position = np.clip(radius / step, 0, len(fine) - 2)
    lower = position.astype(np.intp)
    fraction = position - lower
    profiles = smooth[:, lower] * (1.0 - fraction) + smooth[:, lower + 1] * fraction
    return profiles.reshape(len(contacts), len(DECAYS), -1), contacts


def next_position(
    balls: Sequence[BallContact], grid: WorkingGrid, lit: BoolArray
) -> tuple[float, float]:
    """Return the position (x, y) in mm farthest from all presses, one contact inside the border.

    Parameters
    ----------
    balls : sequence of BallContact
        The presses.
    grid : WorkingGrid
        Nodes and scale.
    lit : (rows, columns) bool
        Visible part of the membrane.
    """
    rows, columns = grid.shape
    contact = float(np.median([ball.contact for ball in balls]))
    margin = min(contact, 0.3 * min(rows, columns))
    x, y = np.meshgrid(
        np.linspace(margin, columns - 1 - margin, 24), np.linspace(margin, rows - 1 - margin, 24)
    )
    nearest = np.min([np.hypot(x - ball.x, y - ball.y) for ball in balls], axis=0)
    nearest[~lit[y.astype(np.intp), x.astype(np.intp)]] = -1.0
    best = np.unravel_index(int(nearest.argmax()), nearest.shape)
    return (
        float(np.interp(x[best], np.arange(columns), grid.x_mm)),
        float(np.interp(y[best], np.arange(rows), grid.y_mm)),
    )
