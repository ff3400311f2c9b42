"""Camera rays of the virtual sensor, from a pixel through the layers to the top surface and back.

Written only for the simulation: the calibration has its own optics, so that an error in either one
shows as a difference. In the sensor frame the layers are perpendicular to z, so the stack is
axially symmetric for any tilt; only the camera is rotated.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .design_parts import CameraDesign, LayerDesign
from .simulation_kernel import Interrupt, never_interrupt

_ROWS_AT_ONCE = 64  # small enough for the processor cache


@dataclass(frozen=True, slots=True)
class RayTable:
    """Rays of the pixels at the flat top surface, with their directions below.

    Attributes
    ----------
    x_mm, y_mm : (rows, columns), or the shape of the points traced
        Point on the undeformed top surface, sensor frame.
    slope_x, slope_y : (rows, columns)
        Lateral shift per mm of depth: the ray is at ``x_mm - depth * slope_x`` at a depth below the
        top surface.
    transmission : (rows, columns)
        Share of the light that passes all faces to the camera (Fresnel, unpolarised).
    """

    x_mm: Float64Array
    y_mm: Float64Array
    slope_x: Float64Array
    slope_y: Float64Array
    transmission: Float64Array


def pixel_directions(camera: CameraDesign, u: Float64Array, v: Float64Array) -> Float64Array:
    """Return camera-frame directions (x, y, 1) of pixels, lens distortion removed.

    Parameters
    ----------
    camera : CameraDesign
        Brown-Conrady lens.
    u, v : (...)
        Pixel coordinates.

    Returns
    -------
    (..., 3)
    """
    xd, yd = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    k1, k2, p1, p2 = camera.distortion
    x, y = xd.copy(), yd.copy()
    if any(camera.distortion):
        for _ in range(12):
            r2 = x * x + y * y
            radial = 1.0 + r2 * (k1 + r2 * k2)
            slope = 2.0 * (k1 + 2.0 * k2 * r2)
            ex = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) - xd
            ey = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y - yd
            j_xx = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
            j_xy = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
            j_yy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
            det = j_xx * j_yy - j_xy * j_xy
            step_x, step_y = (j_yy * ex - j_xy * ey) / det, (j_xx * ey - j_xy * ex) / det
            x -= step_x
            y -= step_y
            # 1e-14 of a direction is 1e-11 of a pixel.
            if max(np.abs(step_x).max(initial=0.0), np.abs(step_y).max(initial=0.0)) < 1e-14:
                break
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def project_to_pixels(camera: CameraDesign, points_mm: Float64Array) -> Float64Array:
    """Return (..., 2) pixels of camera-frame points (..., 3) seen in air."""
    x, y = points_mm[..., 0] / points_mm[..., 2], points_mm[..., 1] / points_mm[..., 2]
    k1, k2, p1, p2 = camera.distortion
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * k2)
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([camera.fx * xd + camera.cx, camera.fy * yd + camera.cy], axis=-1)


def sensor_axes(layers: LayerDesign) -> Float64Array:
    """(3, 3) rows: the sensor's x, y, z axes in the camera frame."""
    normal = layers.normal_camera
    x_axis = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    x_axis /= np.linalg.norm(x_axis)
    return np.stack([x_axis, np.cross(normal, x_axis), normal])


def camera_points(layers: LayerDesign, points_mm: Float64Array) -> Float64Array:
    """Return sensor-frame points (..., 3) in the camera frame."""
    moved = np.asarray(points_mm, dtype=np.float64) + np.array([0.0, 0.0, layers.top_distance_mm])
    return np.asarray(moved @ sensor_axes(layers))


def _steps(
    layers: LayerDesign, height_mm: Float64Array | float
) -> list[tuple[Float64Array, float]]:
    """(thickness, index) of the layers between the camera and a height below the top surface."""
    elastomer, window = layers.elastomer_thickness_mm, layers.window_thickness_mm
    in_elastomer = np.clip(elastomer - np.asarray(height_mm, dtype=np.float64), 0.0, None)
    in_window = np.clip(elastomer + window - height_mm, 0.0, window)
    in_air = np.minimum(layers.air_gap_mm, layers.top_distance_mm - height_mm)
    return [
        (in_air, 1.0),
        (in_window, layers.window_refractive_index),
        (in_elastomer, layers.elastomer_refractive_index),
    ]


def radius_through_layers(
    layers: LayerDesign, sine_in_air: Float64Array, *, height_mm: Float64Array | float = 0.0
) -> Float64Array:
    """Return the distance from the axis at which a ray reaches a height, after Snell at each face.

    Parameters
    ----------
    layers : LayerDesign
        The stack.
    sine_in_air : (...)
        Sine of the angle between the ray in air and the layers' normal.
    height_mm : (...) or float, optional
        Height below the top surface; may be in the elastomer, the window or the air.
    """
    total = np.zeros(np.shape(sine_in_air))
    for thickness, index in _steps(layers, height_mm):
        sine = sine_in_air / index
        total = total + thickness * sine / np.sqrt(1.0 - sine * sine)
    return total


def project_through_layers(
    camera: CameraDesign, layers: LayerDesign, points_mm: Float64Array
) -> Float64Array:
    """Return the pixels at which points inside the stack are visible.

    Solves the monotone radius equation for the sine in air by Newton's method with bisection.

    Parameters
    ----------
    camera, layers : CameraDesign, LayerDesign
        The sensor.
    points_mm : (..., 3)
        Sensor frame; z <= 0.

    Returns
    -------
    (..., 2)
        Pixels.
    """
    lateral = _lateral_to(layers, np.asarray(points_mm, dtype=np.float64))
    along = np.sqrt(1.0 - (lateral * lateral).sum(axis=-1, keepdims=True))
    direction = np.concatenate([lateral, along], axis=-1)
    return project_to_pixels(camera, np.asarray(direction @ sensor_axes(layers)))


def slopes_to(layers: LayerDesign, points_mm: Float64Array) -> Float64Array:
    """Return (..., 2) lateral shifts per mm of the camera's rays to points in the elastomer.

    Parameters
    ----------
    layers : LayerDesign
        The stack.
    points_mm : (..., 3)
        Sensor frame; z <= 0.
    """
    inner = _lateral_to(layers, points_mm) / layers.elastomer_refractive_index
    return np.asarray(inner / np.sqrt(1.0 - (inner * inner).sum(axis=-1, keepdims=True)))


def _lateral_to(layers: LayerDesign, points: Float64Array) -> Float64Array:
    """Return (..., 2): in air, the lateral part of the unit directions of the rays to points."""
    radius = np.hypot(points[..., 0], points[..., 1])
    low, high = np.zeros_like(radius), np.full_like(radius, 1.0 - 1e-12)
    for _ in range(60):
        sine_middle = 0.5 * (low + high)
        too_far = radius_through_layers(layers, sine_middle, height_mm=-points[..., 2]) > radius
        low, high = np.where(too_far, low, sine_middle), np.where(too_far, sine_middle, high)
    sine = 0.5 * (low + high)
    return np.asarray(points[..., :2] * (sine / np.maximum(radius, 1e-300))[..., None])


def reflection(invariant: Float64Array, first_index: float, second_index: float) -> Float64Array:
    """Return the unpolarised Fresnel reflectance of one face, 1 beyond total reflection.

    Parameters
    ----------
    invariant : (...)
        n sin(angle), the same on both sides.
    first_index, second_index : float
        Refractive indices on the two sides.
    """
    cos_1 = np.sqrt(np.clip(1.0 - (invariant / first_index) ** 2, 0.0, None))
    cos_2 = np.sqrt(np.clip(1.0 - (invariant / second_index) ** 2, 0.0, None))
    across = (first_index * cos_1 - second_index * cos_2) / (
        first_index * cos_1 + second_index * cos_2
    )
    along = (first_index * cos_2 - second_index * cos_1) / (
        first_index * cos_2 + second_index * cos_1
    )
    return np.asarray(0.5 * (across * across + along * along))


def bands(first: int, last: int) -> Iterator[tuple[int, int]]:
    """Yield (start, stop) of short blocks of rows."""
    for start in range(first, last, _ROWS_AT_ONCE):
        yield start, min(start + _ROWS_AT_ONCE, last)


def trace_pixels(
    camera: CameraDesign, layers: LayerDesign, *, interrupt: Interrupt = never_interrupt
) -> RayTable:
    """Trace the ray of every pixel to the undeformed top surface.

    Parameters
    ----------
    camera, layers : CameraDesign, LayerDesign
        The sensor.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.

    Returns
    -------
    RayTable
        One entry per pixel; NaN where a ray never reaches the layers.
    """
    parts = []
    for start, stop in bands(0, camera.height_px):
        interrupt()
        v, u = np.mgrid[start:stop, : camera.width_px].astype(np.float64)
        parts.append(trace_points(camera, layers, u, v))
    names = (item.name for item in fields(RayTable))
    return RayTable(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def trace_points(
    camera: CameraDesign, layers: LayerDesign, u: Float64Array, v: Float64Array
) -> RayTable:
    """Trace the rays of any image points to the undeformed top surface.

    Parameters
    ----------
    camera, layers : CameraDesign, LayerDesign
        The sensor.
    u, v : (...)
        Pixel coordinates; they may lie outside the image.

    Returns
    -------
    RayTable
        One entry per point; NaN where a ray never reaches the layers.
    """
    direction = pixel_directions(camera, u, v) @ sensor_axes(layers).T
    sideways = np.hypot(direction[..., 0], direction[..., 1])
    length = np.hypot(sideways, direction[..., 2])
    sine = np.where(direction[..., 2] > 0.0, sideways / length, np.nan)
    # On the axis the lateral direction is 0 / tiny = 0.
    lateral = np.maximum(sideways, 1e-300)
    unit_x, unit_y = direction[..., 0] / lateral, direction[..., 1] / lateral
    radius = radius_through_layers(layers, sine)
    inner = sine / layers.elastomer_refractive_index
    slope = inner / np.sqrt(1.0 - inner * inner)
    elastomer, window = layers.elastomer_refractive_index, layers.window_refractive_index
    if layers.window_thickness_mm == 0.0:
        passed = 1.0 - reflection(sine, 1.0, elastomer)
    else:
        passed = 1.0 - reflection(sine, 1.0, window)
        passed = passed * (1.0 - reflection(sine, window, elastomer))
    return RayTable(unit_x * radius, unit_y * radius, unit_x * slope, unit_y * slope, passed)
