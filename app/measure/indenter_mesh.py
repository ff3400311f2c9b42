"""A fitted indenter as a solid for the 3D view, in the scene's frame (y up, depth up)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.measurement.result import Measurement

if TYPE_CHECKING:
    import pyvista as pv


def solid_of(measurement: Measurement, at_rest: MembraneShape = FLAT) -> pv.PolyData:
    """Return the pressed-in part of a fitted object, from the membrane's level to its top.

    Parameters
    ----------
    measurement : Measurement
        A cylinder, cuboid or ball.
    at_rest : MembraneShape, optional
        The undeformed membrane, over which the depth counts.
    """
    import pyvista as pv  # already loaded by the 3D view, which calls this

    x, y = measurement.centre_mm
    low = measurement.baseline_mm - float(at_rest.height(np.array(measurement.centre_mm)))
    height = measurement.height_mm
    middle = (x, -y, low + 0.5 * height)
    if measurement.shape == "cuboid":
        assert measurement.side_mm is not None
        first, second = measurement.side_mm
        body = pv.Cube(center=middle, x_length=first, y_length=second, z_length=height)
        # The sensor's y axis points down: a positive yaw rotates the other way here.
        return body.rotate_z(-(measurement.yaw_deg or 0.0), point=middle)
    assert measurement.diameter_mm is not None
    radius = 0.5 * measurement.diameter_mm
    if measurement.shape == "cylinder":
        return pv.Cylinder(
            center=middle, direction=(0.0, 0.0, 1.0), radius=radius, height=height, resolution=64
        )
    ball = pv.Sphere(
        radius=radius, center=(x, -y, low + height - radius), theta_resolution=64, phi_resolution=64
    )
    return ball.clip(normal=(0.0, 0.0, 1.0), origin=(x, -y, low), invert=False)
