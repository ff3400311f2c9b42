"""Refraction at flat parallel layers between the camera and the membrane.

The stack is air, an optional window, and the elastomer, all parallel to the top surface, whose
normal may differ from the optical axis. The path from pixel to membrane has a closed form (Snell's
law as vectors); from membrane to pixel, one root in the plane of incidence is found by Newton's
method. The paper's Eq. (3) is the special case of one face and a normal along the optical axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy

from .membrane_shape import FLAT, MembraneShape
from .sensor_frame import TopPlane


@dataclass(frozen=True, slots=True)
class LayerStack:
    """Flat layers under the top surface, from the camera outward.

    Attributes
    ----------
    thicknesses_mm : tuple of floats
        Air gap, [window,] elastomer; their sum is the distance of the top plane.
    indices : tuple of floats
        Refractive indices of the same layers; the first is air's 1.
    """

    thicknesses_mm: tuple[float, ...]
    indices: tuple[float, ...]

    @property
    def distance_mm(self) -> float:
        """Distance of the top surface from the optical centre."""
        return sum(self.thicknesses_mm)


def build_stack(
    distance_mm: float,
    *,
    elastomer_thickness_mm: float,
    elastomer_index: float,
    window_thickness_mm: float = 0.0,
    window_index: float = 1.49,
) -> LayerStack:
    """Return the stack below a top surface, without layers of zero thickness.

    Parameters
    ----------
    distance_mm : float
        From the optical centre to the top surface, along its normal.
    elastomer_thickness_mm, window_thickness_mm : float
        0 if there is none.
    elastomer_index, window_index : float
        Refractive indices.

    Raises
    ------
    InputError
        If the layers are thicker than the distance to the camera.
    """
    air_mm = distance_mm - elastomer_thickness_mm - window_thickness_mm
    if air_mm < 0.0:
        layers_mm = elastomer_thickness_mm + window_thickness_mm
        text = (
            f"Elastomer and window are {layers_mm:.1f} mm thick, but the top surface is only "
            f"{distance_mm:.1f} mm away"
        )
        raise InputError(text, "sensor description", Remedy.CHECK_LENGTHS)
    layers = [
        (air_mm, 1.0),
        (window_thickness_mm, window_index),
        (elastomer_thickness_mm, elastomer_index),
    ]
    present = [layer for layer in layers if layer[0] > 0.0]
    return LayerStack(tuple(t for t, _ in present), tuple(n for _, n in present))


def radius_on_membrane(
    tangent_in_air: Float64Array, stack: LayerStack, beyond_mm: Float64Array | float = 0.0
) -> tuple[Float64Array, Float64Array]:
    """Return the radius at which a ray meets the top surface with its slope in the elastomer.

    Parameters
    ----------
    tangent_in_air : (...)
        Tangent of the ray's angle to the stack's normal, in air.
    stack : LayerStack
        The layers.
    beyond_mm : (...), optional
        How much farther the ray goes in the last layer, along its normal.

    Returns
    -------
    radius_mm : (...)
        Distance from the foot of the perpendicular (the bracket of Eq. 3 times d / f).
    tangent_in_gel : (...)
        Tangent of the angle in the last layer.
    """
    sine = tangent_in_air / np.sqrt(1.0 + tangent_in_air**2)
    radius = np.zeros_like(sine)
    tangent = np.asarray(tangent_in_air, dtype=np.float64)
    for thickness, index in zip(stack.thicknesses_mm, stack.indices, strict=True):
        inside = sine / index
        tangent = inside / np.sqrt(1.0 - inside**2)
        radius = radius + thickness * tangent
    return radius + beyond_mm * tangent, tangent


def tangent_in_air(
    radius_mm: Float64Array, stack: LayerStack, beyond_mm: Float64Array | float = 0.0
) -> Float64Array:
    """Return the tangent in air of the ray that meets the top surface at `radius_mm`.

    Newton's method on the concave, monotone :func:`radius_on_membrane`: a start below the root
    converges from that side without overshoot.

    Parameters
    ----------
    radius_mm : (...)
        Distance from the foot of the perpendicular.
    stack : LayerStack
        The layers.
    beyond_mm : (...), optional
        As in :func:`radius_on_membrane`.
    """
    radius = np.asarray(radius_mm, dtype=np.float64)
    # The paraxial slope is the steepest, so its estimate lies below the root.
    paraxial = sum(t / n for t, n in zip(stack.thicknesses_mm, stack.indices, strict=True))
    tangent = radius / (paraxial + beyond_mm / stack.indices[-1])
    for _ in range(60):
        value, _ = radius_on_membrane(tangent, stack, beyond_mm)
        error = value - radius
        if not np.any(np.abs(error) > 1e-12):
            break
        tangent = np.maximum(tangent - error / _radius_slope(tangent, stack, beyond_mm), 0.0)
    return tangent


def _radius_slope(
    tangent: Float64Array, stack: LayerStack, beyond_mm: Float64Array | float
) -> Float64Array:
    """Return the derivative of the radius with respect to the tangent in air."""
    sine = tangent / np.sqrt(1.0 + tangent**2)
    sine_slope = (1.0 + tangent**2) ** -1.5
    slope = np.zeros_like(tangent)
    layers = (
        *zip(stack.thicknesses_mm, stack.indices, strict=True),
        (beyond_mm, stack.indices[-1]),
    )
    for thickness, index in layers:
        inside = sine / index
        slope = slope + thickness / index * (1.0 - inside**2) ** -1.5 * sine_slope
    return slope


def camera_to_membrane(
    directions: Float64Array, plane: TopPlane, stack: LayerStack, surface: MembraneShape = FLAT
) -> tuple[Float64Array, Float64Array]:
    """Follow camera rays to the undeformed membrane.

    Parameters
    ----------
    directions : (..., 3)
        Ray directions in the camera frame, any length.
    plane, stack
        Top surface and layers.
    surface : MembraneShape, optional
        The membrane over the top surface.

    Returns
    -------
    points_mm : (..., 2)
        Points (x, y) where the rays meet the membrane, sensor frame; NaN for rays that never do.
    ray_slope : (..., 2)
        Ray slope: lateral shift (x, y) of the visible surface point per mm of indentation depth; it
        points towards the foot of the perpendicular.
    """
    in_sensor = np.asarray(directions) @ plane.rotation.T
    sideways = np.hypot(in_sensor[..., 0], in_sensor[..., 1])
    forward = np.where(in_sensor[..., 2] > 0.0, in_sensor[..., 2], np.nan)
    radius, tangent_gel = radius_on_membrane(sideways / forward, stack)
    unit = in_sensor[..., :2] / np.maximum(sideways, 1e-300)[..., None]
    foot, ray_slope = unit * radius[..., None], -unit * tangent_gel[..., None]
    return surface.met_by(foot, ray_slope), ray_slope


def membrane_to_camera(
    points_mm: Float64Array, plane: TopPlane, stack: LayerStack, surface: MembraneShape = FLAT
) -> Float64Array:
    """Return the camera-frame directions (..., 3) towards points of the undeformed membrane.

    Parameters
    ----------
    points_mm : (..., 2)
        Points (x, y) of the undeformed membrane, sensor frame.
    plane, stack, surface
        As in :func:`camera_to_membrane`.
    """
    radius = np.hypot(points_mm[..., 0], points_mm[..., 1])
    tangent = tangent_in_air(radius, stack, 0.0 if surface.flat else surface.height(points_mm))
    unit = points_mm / np.maximum(radius, 1e-300)[..., None]
    in_sensor = np.concatenate(
        [unit * tangent[..., None], np.ones_like(tangent)[..., None]], axis=-1
    )
    return np.asarray(in_sensor @ plane.rotation)
