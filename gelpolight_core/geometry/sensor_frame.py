"""The sensor frame: in the undeformed top surface, below the camera's optical centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float64Array


@dataclass(frozen=True, slots=True)
class TopPlane:
    """The undeformed top surface in the camera frame: ``normal_camera . X = distance_mm``.

    Attributes
    ----------
    normal_camera : tuple of 3 floats
        Unit normal, pointing away from the camera (z > 0).
    distance_mm : float
        Perpendicular distance from the optical centre.
    """

    normal_camera: tuple[float, float, float]
    distance_mm: float

    @property
    def rotation(self) -> Float64Array:
        """(3, 3) rotation, camera frame to sensor frame: the rows are the axes of the sensor frame.

        x is the camera's x axis projected into the plane, z the plane's normal, y completes them.
        """
        z = np.array(self.normal_camera)
        x = np.array([1.0, 0.0, 0.0]) - z[0] * z
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])

    @property
    def origin_camera_mm(self) -> Float64Array:
        """(3,) the foot of the perpendicular from the optical centre."""
        return self.distance_mm * np.array(self.normal_camera)

    def to_sensor(self, points_camera_mm: Float64Array) -> Float64Array:
        """Return points (..., 3) of the camera frame in the sensor frame (z = 0 on the top)."""
        return (np.asarray(points_camera_mm) - self.origin_camera_mm) @ self.rotation.T

    def to_camera(self, points_sensor_mm: Float64Array) -> Float64Array:
        """Return points (..., 3) of the sensor frame in the camera frame."""
        return np.asarray(points_sensor_mm) @ self.rotation + self.origin_camera_mm
