"""The expected camera image of the untouched membrane, from a calibration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.factors.background import flat_cosines
from gelpolight_core.sensor_calibration import Calibration

Array = NDArray[np.float64]
Map = NDArray[np.float32]


def raw_background(calibration: Calibration) -> Map:
    """Return the background of a calibration, as captured by the camera, on the grid.

    Returns
    -------
    (rows, columns, 3) float32
        Linear light; 0 where it is not known.
    """
    valid = calibration.table.valid[..., None]
    if calibration.full is not None:
        mixed = np.minimum(calibration.full.background @ calibration.crosstalk.T, 1.0)
        return np.asarray(np.where(valid, mixed, 0.0), np.float32)
    return np.asarray(calibration.factors * even_membrane(calibration), np.float32)


def even_membrane(calibration: Calibration) -> Array:
    """Return the image of a uniform flat membrane (I_t of Eq. 9), (rows, columns, 3)."""
    cosines = flat_cosines(calibration.table, calibration.led_positions_mm)
    response = [calibration.reflectance.response(k, cosines[..., k]) for k in range(3)]
    return np.asarray(calibration.radiance * np.stack(response, axis=-1))
