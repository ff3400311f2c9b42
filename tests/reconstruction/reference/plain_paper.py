"""The paper's model in plain NumPy and SciPy, as a reference for the fused version.

Written from the equations, array by array, in double precision and not optimised. Tests compare the
fused pass with it, and the benchmark shows both.
"""

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.light.directions import light_directions
from gelpolight_core.sensor.sensor_calibration import Calibration

Array = NDArray[np.float64]


def plain_slopes(frame: NDArray[Any], calibration: Calibration) -> tuple[Array, Array]:
    """Return d(depth)/dx and d(depth)/dy (rows, columns) by Eq. (10), unclipped; 0 where unknown.

    Parameters
    ----------
    frame : (height, width, 3)
        Raw image, RGB; whole numbers or 0..1.
    calibration : Calibration
        Of the sensor.
    """
    table = calibration.table
    full_scale = 1.0 if frame.dtype.kind == "f" else float(np.iinfo(frame.dtype).max)
    where = [table.v_px.astype(np.float64), table.u_px.astype(np.float64)]
    points = table.grid.points_mm()
    at_top = np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)
    light, _ = light_directions(calibration.data.led_positions_mm, at_top)
    cosines = np.zeros((*points.shape[:2], 3))
    strength = calibration.data.radiance.astype(np.float64) * calibration.data.factors
    known = table.valid & (strength > 0.0).all(axis=2)
    for k in range(3):
        channel = frame[..., k].astype(np.float64) / full_scale
        seen = map_coordinates(channel, where, order=1, mode="nearest")
        processed = np.divide(seen, strength[..., k], out=np.zeros_like(seen), where=known)
        cosines[..., k] = calibration.data.reflectance.cosine(k, processed)
    normals = np.linalg.solve(light, cosines[..., None])[..., 0]
    slopes = np.zeros_like(normals[..., :2])
    good = known & (normals[..., 2] < 0.0)
    slopes[good] = normals[good][:, :2] / normals[good][:, 2:]
    return slopes[..., 0], slopes[..., 1]


def plain_depth(slope_x: Array, slope_y: Array, pitch_mm: float) -> Array:
    """Return the depth of slopes by a five-point Poisson solve with depth 0 at the border."""
    rows, columns = slope_x.shape
    along_x = np.zeros((rows, columns + 1))
    along_x[:, 1:-1] = 0.5 * (slope_x[:, 1:] + slope_x[:, :-1])
    along_y = np.zeros((rows + 1, columns))
    along_y[1:-1] = 0.5 * (slope_y[1:] + slope_y[:-1])
    divergence = (np.diff(along_x, axis=1) + np.diff(along_y, axis=0)) * pitch_mm
    wave_y = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, rows + 1) / rows)
    wave_x = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, columns + 1) / columns)
    spectrum = scipy.fft.dstn(-divergence, type=2)
    return np.asarray(scipy.fft.idstn(spectrum / (wave_y[:, None] + wave_x), type=2))
