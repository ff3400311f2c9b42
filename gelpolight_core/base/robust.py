"""Robust scales and weights for all fits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .arrays import Float64Array

SD_OF_MEDIAN = 1.4826
"""Standard deviation of normal errors over the median of their absolute values."""
TUKEY = 4.7
"""Errors in standard deviations from which Tukey's weight is 0: normal errors lose 5 % of their
information."""


def robust_sd(errors: NDArray[np.floating]) -> float:
    """Return the standard deviation about 0 of errors that are normal, but for outliers."""
    return SD_OF_MEDIAN * float(np.median(np.abs(errors)))


def tukey_weights(errors: NDArray[np.floating], cutoff: float) -> Float64Array:
    """Return Tukey's biweight, which is 0 for errors beyond the cut-off."""
    return np.asarray(np.clip(1.0 - (errors / cutoff) ** 2, 0.0, None) ** 2)


def robust_fit(
    errors: Callable[[Float64Array], Float64Array], start: Float64Array, sd: float | None = None
) -> Float64Array:
    """Return the parameters with the least errors, of which large ones count linearly.

    Parameters
    ----------
    errors : callable
        Maps parameters (n,) to errors (m,).
    start : (n,)
        First guess.
    sd : float, optional
        From how large an error on it counts linearly; by default the robust standard deviation at
        `start`, but at least 1e-6.
    """
    from scipy.optimize import least_squares  # slow to import

    scale = max(robust_sd(errors(start)), 1e-6) if sd is None else sd
    return np.asarray(least_squares(errors, start, loss="soft_l1", f_scale=scale).x)
