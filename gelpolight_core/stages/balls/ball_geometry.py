"""Where camera rays meet a pressed ball, and the refinement of its centre on the shading."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.light.directions import light_directions
from gelpolight_core.light.membrane_field import view_directions


@dataclass(frozen=True, slots=True)
class BallPose:
    """The pose of a ball of known radius that is pressed in.

    Attributes
    ----------
    centre_mm : (x, y)
        Centre, sensor frame.
    radius_mm : float
        Radius of the ball.
    depth_mm : float
        Indentation of the ball's lowest point, along z.
    """

    centre_mm: tuple[float, float]
    radius_mm: float
    depth_mm: float

    def middle_mm(self, surface: MembraneShape = FLAT) -> Float64Array:
        """Return the middle (3,) of the ball over a membrane."""
        level_mm = float(surface.height(np.asarray(self.centre_mm)))
        return np.array([*self.centre_mm, level_mm + self.radius_mm - self.depth_mm])


def ball_surface(
    points_mm: Float64Array, ray_slope: Float64Array, pose: BallPose, surface: MembraneShape = FLAT
) -> tuple[Float64Array, Float64Array]:
    """Intersect the camera's rays with the ball.

    Parameters
    ----------
    points_mm : (..., 2)
        Where the rays meet the undeformed membrane.
    ray_slope : (..., 2)
        Lateral displacement of the ray per mm of depth.
    pose : BallPose
        The ball.
    surface : MembraneShape, optional
        The undeformed membrane.

    Returns
    -------
    surface_mm : (..., 3)
        Seen points of the ball, sensor frame; NaN where a ray misses it.
    normals : (..., 3)
        Unit normals there, towards the camera (z < 0).
    """
    centre = pose.middle_mm(surface)
    start = surface.points(points_mm) - centre
    direction = np.concatenate([ray_slope, np.full_like(ray_slope[..., :1], -1.0)], axis=-1)
    a = (direction**2).sum(-1)
    b = (start * direction).sum(-1)
    c = (start**2).sum(-1) - pose.radius_mm**2
    root = np.sqrt(np.where(b * b - a * c > 0.0, b * b - a * c, np.nan))
    # The camera looks along +z: the visible side is the nearer root, with the larger depth.
    depth = (-b + root) / a
    from_centre = start + depth[..., None] * direction
    return from_centre + centre, from_centre / pose.radius_mm


@dataclass(frozen=True, slots=True)
class ShadedPixels:
    """Pixels of a ball press, for the refinement of its centre on the shading.

    Attributes
    ----------
    points_mm, ray_slope : (N, 2)
        Rays, as for :func:`ball_surface`.
    ratio : (N, 3)
        Press over background: radiance and reflectance factor cancel.
    weight : (N, 3)
        1 / standard deviation of the ratio; 0 for pixels that do not count.
    """

    points_mm: Float64Array
    ray_slope: Float64Array
    ratio: Float64Array
    weight: Float64Array


def refine_centre(
    pixels: ShadedPixels,
    start: BallPose,
    led_positions_mm: Float64Array,
    at_rest: MembraneShape = FLAT,
) -> tuple[BallPose, float, float]:
    """Refine the position of the ball so that its shading explains the image.

    The light's direction, inverse square and lobe are those at the ball's surface. The membrane is
    modelled as a blend of ``cos^m`` and a glossy lobe about the half vector between light and view.
    Without the glossy share, the centre would be too far outside, because gloss shifts the shading
    towards the viewer.

    Parameters
    ----------
    pixels : ShadedPixels
        Inside of the contact.
    start : BallPose
        First estimate; radius and depth are kept.
    led_positions_mm : (3, 3)
        LED positions, sensor frame.
    at_rest : MembraneShape, optional
        The undeformed membrane.

    Returns
    -------
    pose : BallPose
        With the refined centre.
    residual : float
        Robust relative misfit of the shading.
    sd_mm : float
        Standard deviation of the centre from the misfit, larger axis.
    """
    from scipy.optimize import least_squares  # slow to import

    flat = at_rest.points(pixels.points_mm)
    flat_light, flat_distance = light_directions(led_positions_mm, flat)
    view = view_directions(pixels.ray_slope)
    on_flat = _cosines(flat_light, at_rest.normals(pixels.points_mm), view)
    weight = pixels.weight

    @lru_cache(maxsize=4)  # most derivatives leave the ball where it is
    def shading_at(
        x_mm: float, y_mm: float
    ) -> tuple[Float64Array, tuple[Float64Array, Float64Array]]:
        pose = BallPose((x_mm, y_mm), start.radius_mm, start.depth_mm)
        surface, normals = ball_surface(pixels.points_mm, pixels.ray_slope, pose, at_rest)
        light, distance = light_directions(led_positions_mm, surface)
        gain = light[..., 2] / flat_light[..., 2] * (flat_distance / distance) ** 2
        return gain, _cosines(light, normals, view)

    def model(parameters: Float64Array) -> Float64Array:
        gain, cosines = shading_at(float(parameters[0]), float(parameters[1]))
        lit, flat_lit = (_blend(shading, parameters[2:]) for shading in (cosines, on_flat))
        return np.asarray(gain * lit / flat_lit)

    def residual(parameters: Float64Array) -> Float64Array:
        error = np.nan_to_num((model(parameters) - pixels.ratio) * weight, nan=10.0)
        return np.asarray(error.ravel())

    guess = np.array([*start.centre_mm, 1.0, 0.1, 10.0])
    typical_error = max(robust_sd(residual(guess)[weight.ravel() > 0.0]), 1e-6)
    span = 0.5 * start.radius_mm
    low = np.array([guess[0] - span, guess[1] - span, 0.3, 0.0, 1.0])
    high = np.array([guess[0] + span, guess[1] + span, 3.0, 0.9, 60.0])
    fit = least_squares(
        residual,
        guess,
        bounds=(low, high),
        x_scale=[0.1, 0.1, 0.3, 0.1, 5.0],
        loss="soft_l1",
        f_scale=typical_error,
    )
    residuals = residual(fit.x)[weight.ravel() > 0.0]
    misfit = robust_sd(residuals)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * misfit**2
    relative = misfit / float(np.median(weight[weight > 0.0]))
    pose = BallPose((float(fit.x[0]), float(fit.x[1])), start.radius_mm, start.depth_mm)
    return pose, relative, float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2]).max()))


def _cosines(
    light: Float64Array, normals: Float64Array, view: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the cosines (N, 3) of the light and of the half vector to the normals."""
    cosine = np.clip(np.einsum("nkc,nc->nk", light, normals), 1e-3, 1.0)
    half = light + view[:, None, :]
    length = np.sqrt(np.einsum("nkc,nkc->nk", half, half))
    return cosine, np.clip(np.einsum("nkc,nc->nk", half, normals) / length, 0.0, 1.0)


def _blend(cosines: tuple[Float64Array, Float64Array], shape: Float64Array) -> Float64Array:
    """Return the brightness (N, 3) of a diffuse and glossy membrane.

    `shape` is (exponent of cos, glossy share, exponent of the half-vector cosine).
    """
    diffuse, glossy = cosines[0] ** shape[0], cosines[1] ** shape[2]
    return np.asarray((1.0 - shape[1]) * diffuse + shape[1] * glossy)
