"""The common method: one table from colour to slope, n = F(I) (the paper's Eq. 2).

Light is assumed parallel and uniform, so that a colour gives the same slope everywhere. The colour
is the relative change I / I0 - 1. Colours that no ball has shown get the slope of the nearest
colour of a ball.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from gelpolight_core.experiments.rivals.samples import BallSamples, Map, Predict, require_pixels

BINS = 48
SPREAD = 99.8


def fit_table(samples: BallSamples) -> Predict:
    """Fill the table with the mean slope of each colour.

    Parameters
    ----------
    samples : BallSamples
        Of all presses.

    Raises
    ------
    InputError
        If the balls show too few pixels.
    """
    require_pixels(samples)
    low, high = np.percentile(samples.change, [100.0 - SPREAD, SPREAD], axis=0).astype(np.float32)
    step = np.maximum((high - low) / BINS, np.float32(1e-6))
    at = _bins(samples.change, low, step)
    flat = np.ravel_multi_index((at[:, 0], at[:, 1], at[:, 2]), (BINS,) * 3)
    count = np.bincount(flat, minlength=BINS**3).reshape((BINS,) * 3)
    sums = [np.bincount(flat, samples.slopes[:, k], BINS**3).reshape(count.shape) for k in (0, 1)]
    mean = np.stack([total / np.maximum(count, 1) for total in sums], axis=-1)
    nearest = distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    table = mean[tuple(nearest)].astype(np.float32)

    def predict(change: Map, _position_mm: Map) -> Map:
        found = _bins(change, low, step)
        return np.asarray(table[found[:, 0], found[:, 1], found[:, 2]], np.float32)

    return predict


def _bins(change: Map, low: Map, step: Map) -> NDArray[np.int32]:
    # Clipped before the cast: a wall can change by more than the range of integers.
    return np.asarray(np.clip((change - low) / step, 0, BINS - 1), np.int32)
