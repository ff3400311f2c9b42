"""The depth map of the fitted object, and the residual."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

from .indenter_models import MODELS
from .result import Measurement
from .segmentation import MARGIN_MM


def fitted_depth(
    measurement: Measurement,
    x_mm: NDArray[np.floating],
    y_mm: NDArray[np.floating],
    at_rest: MembraneShape = FLAT,
) -> NDArray[np.float64]:
    """Return the depth (mm) of the fitted object with its drape and baseline.

    Parameters
    ----------
    measurement : Measurement
        A fitted cylinder, cuboid or ball.
    x_mm, y_mm : arrays of one shape
        Places in the sensor frame.
    at_rest : MembraneShape, optional
        The undeformed membrane.

    Returns
    -------
    depth_mm : array of that shape
    """
    values = {
        "x_mm": measurement.centre_mm[0],
        "y_mm": measurement.centre_mm[1],
        "height_mm": measurement.height_mm,
        "drape_decay_mm": measurement.drape_decay_mm,
        "edge_radius_mm": measurement.edge_radius_mm or 0.0,
    }
    if measurement.side_mm is not None:
        first, second = measurement.side_mm
        turned = np.radians(measurement.yaw_deg or 0.0)
        values |= {"side_a_mm": first, "side_b_mm": second, "yaw": float(turned)}
    else:
        assert measurement.diameter_mm is not None
        values["diameter_mm"] = measurement.diameter_mm
    x, y = np.asarray(x_mm, np.float64), np.asarray(y_mm, np.float64)
    depth_mm = MODELS[measurement.shape].on(at_rest).depth(values, x, y)
    return depth_mm + measurement.baseline_mm


def fit_residual(heightmap: HeightMap, measurement: Measurement) -> NDArray[np.float32]:
    """Return depth less fitted depth (mm) around a measured object, NaN elsewhere.

    Parameters
    ----------
    heightmap : HeightMap
        What was measured.
    measurement : Measurement
        A fitted object in it.

    Returns
    -------
    residual_mm : (rows, columns) float32
        Finite in the object's bounding box and 3 mm around it, the area of the fit.
    """
    left, top = measurement.outline_mm.min(axis=0) - MARGIN_MM
    right, bottom = measurement.outline_mm.max(axis=0) + MARGIN_MM
    columns = np.flatnonzero((heightmap.x_mm >= left) & (heightmap.x_mm <= right))
    rows = np.flatnonzero((heightmap.y_mm >= top) & (heightmap.y_mm <= bottom))
    residual = np.full(heightmap.depth_mm.shape, np.nan, np.float32)
    if rows.size and columns.size:
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        x, y = np.meshgrid(heightmap.x_mm[window[1]], heightmap.y_mm[window[0]])
        depth = fitted_depth(measurement, x, y, heightmap.at_rest)
        outside = heightmap.flags[window] & np.uint8(Flag.OUTSIDE) != 0
        residual[window] = np.where(outside, np.nan, heightmap.depth_mm[window] - depth)
    return residual
