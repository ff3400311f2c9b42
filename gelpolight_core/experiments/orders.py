"""Orders of convergence, with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from gelpolight_core.translation import tr

LEAST_SIZES = 3
BY_PIXELS, BY_MODEL = 1.0, 0.3


@dataclass(frozen=True, slots=True)
class Order:
    """Order of an error in the pitch: the slope of a line in log-log coordinates.

    Attributes
    ----------
    value : float
        The exponent.
    half_width : float
        Half of its 95 % confidence interval.
    sizes : int
        Pitches of the fit.
    """

    value: float
    half_width: float
    sizes: int

    @property
    def text(self) -> str:
        """The exponent and its uncertainty."""
        return f"{self.value:.2f} ± {self.half_width:.2f}"

    @property
    def limit(self) -> str:
        """What limits the method; empty if the fit does not support a statement."""
        if self.value - self.half_width > BY_PIXELS:
            return tr("the pixel size")
        if self.value + self.half_width < BY_MODEL:
            return tr("not the pixel size")
        return ""


def fit_order(pitch_mm: Sequence[float], errors: Sequence[float]) -> Order | None:
    """Fit the order; None with fewer than three different pitches or an error that is not above 0.

    Parameters
    ----------
    pitch_mm, errors : sequence of float
        Of each size.
    """
    sizes = len(set(pitch_mm))
    if sizes < LEAST_SIZES or min(errors) <= 0.0:
        return None
    x, y = np.log(pitch_mm), np.log(errors)
    away = x - x.mean()
    slope = float(away @ y / (away @ away))
    left = y - y.mean() - slope * away
    free = len(x) - 2
    sd = float(np.sqrt(left @ left / free / (away @ away)))
    return Order(slope, float(student.ppf(0.975, free)) * sd, sizes)
