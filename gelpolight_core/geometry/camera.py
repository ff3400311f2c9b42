"""The camera: a pinhole with Brown-Conrady distortion, in OpenCV's convention."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float64Array


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Intrinsics of the camera.

    Attributes
    ----------
    width, height : int
        Image size in pixels.
    fx, fy, cx, cy : float
        Focal lengths and principal point in pixels; pixel centres have integer coordinates.
    distortion : tuple of 5 floats
        (k1, k2, p1, p2, k3), OpenCV's order.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Float64Array:
        """(3, 3) camera matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def fold(self) -> float:
        """Tangent of the angle at which the distortion turns back, infinite if it never does.

        Beyond it the model maps two directions to one pixel, which no lens does.
        """
        k1, k2, _, _, k3 = self.distortion
        # The derivative of r (1 + k1 r^2 + k2 r^4 + k3 r^6), by falling powers of r^2.
        roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
        squares = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real
        return float(np.sqrt(squares.min())) if squares.size else float("inf")

    def directions(self, pixels: Float64Array) -> Float64Array:
        """Return the undistorted directions (x, y, 1) of pixels.

        Parameters
        ----------
        pixels : (..., 2)
            (u, v) in pixels.

        Returns
        -------
        (..., 3)
            Directions in the camera frame, third component 1.
        """
        flat = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-14)
        ideal = cv2.undistortPoints(flat, self.matrix, np.array(self.distortion), criteria=criteria)
        ideal = np.asarray(ideal, dtype=np.float64).reshape(*np.shape(pixels)[:-1], 2)
        return np.concatenate([ideal, np.ones_like(ideal[..., :1])], axis=-1)

    def project(self, points_mm: Float64Array) -> Float64Array:
        """Return the pixels (u, v) of points or directions in the camera frame.

        Parameters
        ----------
        points_mm : (..., 3)
            In front of the camera (z > 0).
        """
        points = np.asarray(points_mm, dtype=np.float64)
        x = points[..., 0] / points[..., 2]
        y = points[..., 1] / points[..., 2]
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        return np.stack([self.fx * xd + self.cx, self.fy * yd + self.cy], axis=-1)
