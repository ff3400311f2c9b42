"""Light that changes from row to row of an image, under a rolling shutter.

Mains, LEDs that are dimmed by pulses, and an exposure that is changed in mid frame cause it. It is
a sum of cosines over the rows, or a step; only what is above the noise is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array

from .health_samples import RUN, RUNS_OF_CELL

CLEAR = 4.0
"""Deviations from which on a cosine is kept: by chance one of 16,000 is."""
FAR, ROUNDS = 4.0, 4
"""Robust deviations from which on a run is left out, and rounds for finding those."""
QUARTILE = NormalDist().inv_cdf(0.75)
LEAST_SHARE = 0.05
"""Share of the runs above and below a step."""


@dataclass(frozen=True, slots=True)
class RowLight:
    """A change of the light by row.

    Attributes
    ----------
    height : int
        Rows of the image.
    step : float or None
        First row after a sudden change, if there is one.
    orders : (n,)
        Half periods of each cosine over the height.
    shares : (n or n + 1, 3)
        Sizes in each channel, as a share of the light: of the cosines, then of the step.
    sd : float
        Standard deviation of the light of a row.
    """

    height: int
    step: float | None
    orders: Float64Array
    shares: Float64Array
    sd: float

    def at(self, row: NDArray[Any]) -> Float64Array:
        """Return the share (..., 3) by which the light of rows has changed."""
        return row_shapes(row, self.height, self.orders, self.step) @ self.shares

    def over_image(self) -> Float32Array:
        """Return the factor (height, 1, 3) of each row."""
        return np.asarray(1.0 + self.at(np.arange(self.height))[:, None], np.float32)

    @property
    def largest(self) -> float:
        """Largest share of its change, from the darkest to the brightest row."""
        return float(np.ptp(self.at(np.arange(self.height)), axis=0).max())


def row_shapes(
    row: NDArray[Any], height: int, orders: Float64Array, step: float | None
) -> Float64Array:
    """Return the cosines, and the step if there is one, at rows; each 0 on average."""
    down = (np.asarray(row, np.float64)[..., None] + 0.5) / height
    shapes = np.cos(np.pi * down * orders)
    if step is None:
        return shapes
    after = np.asarray(down * height - 0.5 >= step, np.float64) - (1.0 - step / height)
    return np.concatenate([shapes, after], axis=-1)


def fit_rows(
    row: Float64Array, share: Float64Array, weight: Float64Array, height: int, *, sudden: bool
) -> RowLight | None:
    """Fit a change by row to the light of runs, or return None where there is none.

    Parameters
    ----------
    row : (runs,)
        Rows of the camera.
    share : (runs, 3)
        Change of their light, as a share.
    weight : (runs,)
        1 where a run shows the untouched membrane, 0 where it does not.
    height : int
        Rows of the image.
    sudden : bool
        Whether to fit a step instead of cosines.
    """
    # A run covers a row or two; a cosine needs several runs.
    most = min(height // RUN, int(np.count_nonzero(weight > 0.5)) // RUNS_OF_CELL)
    step = _step(row, share, weight) if sudden else None
    orders = np.arange(1.0, 1.0 if sudden else most)
    given = weight
    while orders.size or step is not None:
        basis = np.column_stack([np.ones(row.size), row_shapes(row, height, orders, step)])
        for _ in range(ROUNDS):
            left = basis * weight[:, None]
            # A prior of the light of a run keeps what no run shows at 0.
            inverse = np.linalg.inv(left.T @ basis + np.eye(basis.shape[1]))
            values = inverse @ (left.T @ share)
            rest = np.abs(share - basis @ values).max(axis=1)
            usual = max(float(np.median(rest[given > 0.5])), np.finfo(float).tiny)
            weight = given * np.maximum(1.0 - (rest / (FAR * usual)) ** 2, 0.0) ** 2
        variance = (weight[:, None] * (share - basis @ values) ** 2).sum(axis=0)
        variance /= max(float(weight.sum()) - len(values), 1.0)
        sd = np.sqrt(np.outer(np.diag(inverse), variance))[1:]
        clear = np.asarray((np.abs(values[1:]) > CLEAR * sd).any(axis=1))
        if clear.all():
            return RowLight(height, step, orders, values[1:], float(np.hypot.reduce(sd).max()))
        if not clear[orders.size :].all():
            step = None
        orders = orders[clear[: orders.size]]
    return None


def _step(row: Float64Array, share: Float64Array, weight: Float64Array) -> float | None:
    """Return the row whose change explains most of the light, None where there are few runs."""
    order = np.argsort(row)
    middle = np.median(share, axis=0)
    far = FAR / QUARTILE * np.median(np.abs(share - middle), axis=0)
    share = np.clip(share - middle, -far, far)
    weight, light = weight[order], (weight[:, None] * share)[order]
    above, total = np.cumsum(weight)[:-1], float(weight.sum())
    sums, mean = np.cumsum(light, axis=0)[:-1], light.sum(axis=0) / max(total, 1.0)
    below = total - above
    known = np.flatnonzero(np.minimum(above, below) > LEAST_SHARE * total)
    if not known.size:
        return None
    apart = sums - above[:, None] * mean
    explained = (apart**2).sum(axis=1)[known] * total / (above * below)[known]
    at = int(np.argmax(explained))
    return float(row[order][1:][known][at])
