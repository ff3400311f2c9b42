"""A pressed ball with the membrane draped around it, seen along the camera's rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import k0, k1

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.geometry.drape import STEEPEST, ball_contact_from_depth
from gelpolight_core.geometry.membrane_shape import FLAT, STEP_MM, MembraneShape

from .ball_geometry import BallPose

ROUNDS = 6
TERMS, ANGLES = 7, 32
"""Series of the free membrane around a contact that is not round: on a slope of 30 degrees right
to 0.1 um, with 5 terms to 1 um."""


class DrapedBall(NamedTuple):
    """A ball in a curved membrane with its contact and the free membrane around it.

    The membrane is the same elastic foundation as a flat one, and moves along z: where it is free,
    ``decay^2 laplacian(w) = w``, so that w is the real part of the sum of ``a_m K_m(r / decay)
    exp(i m phi)``; it leaves the ball tangentially.

    Attributes
    ----------
    pose : BallPose
        The ball.
    surface : MembraneShape
        The undeformed membrane.
    decay_mm : float
        Decay length of the membrane.
    middle_mm : (2,)
        Inside of the contact; r and phi are about it.
    edge_mm : (`ANGLES`,)
        Radius of the contact.
    terms : (`TERMS`,) complex
        The factors a_m.
    """

    pose: BallPose
    surface: MembraneShape
    decay_mm: float
    middle_mm: Float64Array
    edge_mm: Float64Array
    terms: NDArray[np.complex128]

    @classmethod
    def of(cls, pose: BallPose, surface: MembraneShape, decay_mm: float) -> DrapedBall:
        """Return the drape of a ball."""
        centre_mm = pose.middle_mm(surface)
        foot_mm = surface.nearest(centre_mm)
        sunk_mm = pose.radius_mm - float(np.linalg.norm(centre_mm - surface.points(foot_mm)))
        start = _contact(sunk_mm, pose.radius_mm, decay_mm)
        edge, terms = np.full(ANGLES, start), np.zeros(TERMS, np.complex128)
        drape = cls(pose, surface, decay_mm, foot_mm, edge, terms)
        out = np.exp(2j * np.pi * np.arange(ANGLES) / ANGLES)
        for _ in range(ROUNDS):
            # Newton's step: where the free membrane is as deep as the ball, its slope must be too.
            radii = edge + STEP_MM * np.array([[-1.0], [0.0], [1.0]])
            points = foot_mm + radii[..., None] * np.stack([out.real, out.imag], axis=-1)
            ball = drape.touching(points)
            waves = drape.waves(points)[1:-1]
            real = np.concatenate([waves.real, -waves[1:].imag])
            coefficients = np.linalg.lstsq(real[:, 1].T, ball[1], rcond=None)[0]
            gap_inside, gap, gap_outside = np.tensordot(coefficients, real, 1) - ball
            curvature = np.maximum(gap_inside + gap_outside - 2.0 * gap, STEP_MM**2 / decay_mm)
            shift = 0.5 * STEP_MM * (gap_inside - gap_outside) / curvature
            edge = edge + np.clip(shift, -0.3 * edge, 0.3 * edge)
            terms = coefficients[:TERMS] + 1j * np.append(0.0, coefficients[TERMS:])
        return drape._replace(edge_mm=edge, terms=terms)

    def touching(self, points_mm: Float64Array) -> Float64Array:
        """Return the depth (...) of a membrane that touches the ball, at points (..., 2)."""
        height_over_middle = self.surface.height(points_mm) - self.pose.middle_mm(self.surface)[2]
        return np.asarray(height_over_middle + self._root(points_mm - self.pose.centre_mm))

    def waves(self, points_mm: Float64Array) -> NDArray[np.complex128]:
        """Return ``K_m(r / decay) exp(i m phi)`` for m from -1 to `TERMS`, at points (..., 2)."""
        offset = (points_mm - self.middle_mm) / self.decay_mm
        r = np.maximum(np.hypot(offset[..., 0], offset[..., 1]), 1e-6)
        direction = (offset[..., 0] + 1j * offset[..., 1]) / r
        bessel = [k1(r), k0(r), k1(r)]
        for m in range(1, TERMS):
            bessel.append(bessel[-2] + 2.0 * m / r * bessel[-1])
        return np.asarray([b * direction**m for m, b in enumerate(bessel, -1)])

    def at(self, points_mm: Float64Array) -> tuple[Float64Array, Float64Array, BoolArray]:
        """Return depth (N,), slopes (N, 2) and a mask of the contact at points (N, 2)."""
        x, y = (points_mm - self.middle_mm).T
        angles = np.linspace(0.0, 2.0 * np.pi, ANGLES + 1)
        r, edge = np.hypot(x, y), np.append(self.edge_mm, self.edge_mm[0])
        on_ball = r < np.interp(np.arctan2(y, x) % (2.0 * np.pi), angles, edge)
        depth, slopes = np.zeros(len(r)), np.zeros((len(r), 2))
        ball = points_mm[on_ball] - self.pose.centre_mm
        depth[on_ball] = self.touching(points_mm[on_ball])
        slopes[on_ball] = self.surface.slopes(points_mm[on_ball]) - ball / self._root(ball)[:, None]
        # At 12 decay lengths from a contact, a curved membrane is at rest to 1e-5 of the depth.
        free = ~on_ball & (r < edge.max() + 12.0 * self.decay_mm)
        waves = self.waves(points_mm[free])
        depth[free] = (self.terms @ waves[1:-1]).real
        # The derivatives along x + iy and x - iy raise and lower m.
        up, down = self.terms @ waves[2:], self.terms @ waves[:-2]
        slopes[free] = np.stack([(up + down).real, (up - down).imag], axis=-1)
        slopes[free] /= -2.0 * self.decay_mm
        return depth, slopes, on_ball

    def _root(self, offset_mm: Float64Array) -> Float64Array:
        """Return the height (...) of the ball's surface over its equator at offsets (..., 2)."""
        square = np.minimum((offset_mm**2).sum(axis=-1), (STEEPEST * self.pose.radius_mm) ** 2)
        return np.asarray(np.sqrt(self.pose.radius_mm**2 - square))


def draped_ball(
    points_mm: Float64Array,
    ray_slope: Float64Array,
    pose: BallPose,
    *,
    decay_mm: float,
    surface: MembraneShape = FLAT,
) -> tuple[Float64Array, Float64Array, BoolArray]:
    """Return the point and normal where each ray meets a pressed ball or its drape.

    Inside the contact the membrane is the ball; outside it decays as on an elastic foundation,
    ``w = w_a K0(r / decay) / K0(a / decay)`` for a flat membrane, and leaves the ball tangentially.

    Parameters
    ----------
    points_mm, ray_slope : (N, 2)
        Intersections of the rays with the undeformed membrane, and their lateral displacement
        per mm of depth.
    pose : BallPose
        The ball.
    decay_mm : float
        Decay length of the membrane.
    surface : MembraneShape, optional
        The undeformed membrane.

    Returns
    -------
    surface_mm : (N, 3)
        Seen points, sensor frame.
    normals : (N, 3)
        Unit normals towards the camera.
    on_ball : (N,)
        Whether the point is in the contact.
    """
    if surface.flat:
        return _on_flat(points_mm, ray_slope, pose, decay_mm)
    drape, rest_height = DrapedBall.of(pose, surface, decay_mm), surface.height(points_mm)
    travel = np.zeros(len(points_mm))
    for _ in range(ROUNDS):  # each round shrinks the error by slope times ray slope
        points = points_mm + travel[:, None] * ray_slope
        travel = rest_height - surface.height(points) + drape.at(points)[0]
    points = points_mm + travel[:, None] * ray_slope
    _, slopes, on_ball = drape.at(points)
    slopes = surface.slopes(points) - slopes
    normals = np.concatenate([slopes, np.full((len(points), 1), -1.0)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([points, (rest_height - travel)[:, None]], axis=1), normals, on_ball


def _contact(depth_mm: float, radius_mm: float, decay_mm: float) -> float:
    contact_mm = ball_contact_from_depth(depth_mm, radius_mm, decay_mm=decay_mm)
    return min(contact_mm, STEEPEST * radius_mm)


def _on_flat(
    points_mm: Float64Array, ray_slope: Float64Array, pose: BallPose, decay_mm: float
) -> tuple[Float64Array, Float64Array, BoolArray]:
    """Return the result of :func:`draped_ball` for a flat membrane, in closed form."""
    radius, start_offset_mm = pose.radius_mm, points_mm - pose.centre_mm
    contact = _contact(pose.depth_mm, radius, decay_mm)
    ring = pose.depth_mm - radius + np.sqrt(radius**2 - contact**2)
    share = ring / k0(contact / decay_mm)
    x, y = np.ascontiguousarray(start_offset_mm.T)
    slope_x, slope_y = np.ascontiguousarray(ray_slope.T)

    def profile(r: Float64Array) -> Float64Array:
        depth = pose.depth_mm - radius + np.sqrt(radius**2 - np.minimum(r, contact) ** 2)
        free = r >= contact
        depth[free] = share * k0(r[free] / decay_mm)
        return depth

    depth = np.full(len(start_offset_mm), 0.5 * pose.depth_mm)
    for _ in range(ROUNDS):  # each round shrinks the error by slope times ray slope, about a tenth
        depth = profile(np.hypot(x + depth * slope_x, y + depth * slope_y))
    offset = start_offset_mm + depth[:, None] * ray_slope
    r = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-9)
    free, inside = r >= contact, np.minimum(r, contact)
    slope = -inside / np.sqrt(radius**2 - inside**2)
    slope[free] = -share / decay_mm * k1(r[free] / decay_mm)
    normals = np.concatenate([-slope[:, None] * offset / r[:, None], -np.ones((len(r), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([offset + pose.centre_mm, -depth[:, None]], axis=1), normals, ~free
