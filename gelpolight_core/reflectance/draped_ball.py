"""A pressed ball with the membrane draped around it, seen along the camera's rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import k0, k1

from gelpolight_core.reflectance.ball import BallPose, contact_radius_from_depth
from gelpolight_core.surface import FLAT, Surface

Array = NDArray[np.float64]
ROUNDS = 6
NEAR_MM = 1.0
"""From how far the curvature of a membrane is taken."""
AT_REST = 8.0
"""Decay lengths from a ball at which a curved membrane is at rest."""


class Frame(NamedTuple):
    """The membrane's tangent plane below a ball: there it is a ball on a flat membrane.

    Attributes
    ----------
    foot_mm : (3,)
        Point of the membrane at rest that is nearest to the ball's middle.
    axes : (3, 3)
        Rows: two tangents, and the normal away from the camera.
    curvature_per_mm : float
        Mean of the membrane at rest there, positive where it bulges outwards.
    """

    foot_mm: Array
    axes: Array
    curvature_per_mm: float

    @classmethod
    def below(cls, middle_mm: Array, surface: Surface) -> Frame:
        """Return the frame below a ball's middle (3,)."""
        place = surface.nearest(middle_mm)
        normal = -surface.normals(place)
        along = np.array([normal[2], 0.0, -normal[0]]) / np.hypot(normal[0], normal[2])
        axes = np.stack([along, np.cross(normal, along), normal])
        near = place + NEAR_MM * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        falls = surface.points(place) - surface.points(near)
        curvature = float(np.mean(2.0 * (falls @ normal) / (falls**2).sum(axis=1)))
        return cls(surface.points(place), axes, curvature)


def draped_ball(
    points_mm: Array,
    ray_slope: Array,
    pose: BallPose,
    *,
    decay_mm: float,
    surface: Surface = FLAT,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the point and normal where each ray meets a pressed ball or its drape.

    Inside the contact the membrane is the ball; outside it decays as on an elastic foundation,
    ``w = w_a K0(r / decay) / K0(a / decay)``, and leaves the ball tangentially. On a curved
    membrane, the same holds in the frame of its tangent plane below the ball.

    Parameters
    ----------
    points_mm, ray_slope : (N, 2)
        Intersections of the rays with the undeformed membrane, and their lateral displacement
        per mm of depth.
    pose : BallPose
        The ball.
    decay_mm : float
        Decay length of the membrane.
    surface : Surface, optional
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
        return _on_tangent_plane(points_mm - pose.centre_mm, ray_slope, pose, decay_mm, 0.0)
    middle = pose.middle_mm(surface)
    frame = Frame.below(middle, surface)
    sunk_mm = pose.radius_mm - float((middle - frame.foot_mm) @ frame.axes[2])
    from_foot = (surface.points(points_mm) - frame.foot_mm) @ frame.axes.T
    rays = np.concatenate([ray_slope, -np.ones((len(ray_slope), 1))], axis=1) @ frame.axes.T
    across = rays[:, :2] / -rays[:, 2:]
    local = BallPose((0.0, 0.0), pose.radius_mm, sunk_mm)
    beside = from_foot[:, :2] + from_foot[:, 2:] * across
    seen, normals, on_ball = _on_tangent_plane(
        beside, across, local, decay_mm, frame.curvature_per_mm
    )
    seen, normals = seen @ frame.axes + frame.foot_mm, normals @ frame.axes
    # The drape has fallen by exp(-8) where the parabola is no longer the membrane.
    at_rest = np.hypot(*beside.T) > pose.radius_mm + AT_REST * decay_mm
    seen[at_rest] = surface.points(points_mm[at_rest])
    normals[at_rest] = surface.normals(points_mm[at_rest])
    return seen, normals, on_ball


def _on_tangent_plane(
    beside_mm: Array, ray_slope: Array, pose: BallPose, decay_mm: float, curvature: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the result of :func:`draped_ball` for rays through points (N, 2) from its centre.

    The membrane at rest falls by half its curvature times the squared distance.
    """
    radius = pose.radius_mm
    contact = contact_radius_from_depth(
        pose.depth_mm, radius, decay_mm=decay_mm, curvature_per_mm=curvature
    )
    ring = pose.depth_mm - radius + np.sqrt(radius**2 - contact**2) - 0.5 * curvature * contact**2
    share = ring / k0(contact / decay_mm)
    x, y = np.ascontiguousarray(beside_mm.T)
    slope_x, slope_y = np.ascontiguousarray(ray_slope.T)

    def profile(r: Array) -> Array:
        depth = pose.depth_mm - radius + np.sqrt(radius**2 - np.minimum(r, contact) ** 2)
        free = r >= contact
        depth[free] = share * k0(r[free] / decay_mm) + 0.5 * curvature * r[free] ** 2
        return depth

    depth = np.full(len(beside_mm), 0.5 * pose.depth_mm)
    for _ in range(ROUNDS):  # each round shrinks the error by slope times ray slope, about a tenth
        depth = profile(np.hypot(x + depth * slope_x, y + depth * slope_y))
    away = beside_mm + depth[:, None] * ray_slope
    r = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
    free, inside = r >= contact, np.minimum(r, contact)
    slope = -inside / np.sqrt(radius**2 - inside**2)
    slope[free] = curvature * r[free] - share / decay_mm * k1(r[free] / decay_mm)
    normals = np.concatenate([-slope[:, None] * away / r[:, None], -np.ones((len(r), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([away + pose.centre_mm, -depth[:, None]], axis=1), normals, ~free
