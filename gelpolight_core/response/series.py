"""Fit a camera's inverse response to pictures of one still scene at different exposures.

The local exponent d(ln light)/d(ln value) is a broken line over the value: 1 everywhere for a
linear camera, 2.2 everywhere for a gamma of 2.2. Its integral is linear in its corners, rises as
long as they are positive, and the light of each place in the scene drops out in closed form, so
that the fit is one small bounded least-squares problem per channel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Dense where numbers are small, as the eye's and most cameras' curves bend there.
CORNERS = (np.arange(1, 13) / 12.0) ** 2
LEAST_EXPONENT, LARGEST_EXPONENT = 0.05, 20.0
# From corner to corner sRGB's exponent changes by up to 0.4; where the pictures say nothing, the
# exponent is expected to change no more than this.
EXPONENT_STEP = 0.5
# Shutters and lamps repeat to about this share of the light.
REPEATABILITY = 0.003
BLOCKS = 1200
# A block in which values differ by more holds an edge, or is mostly noise: bent noise is no longer
# centred on the bent value (0.15 % off at this limit and a gamma of 2.2).
LARGEST_SPREAD = 0.05
ROUNDS = 6
TUKEY = 4.7


@dataclass(frozen=True, slots=True)
class Series:
    """One channel of an exposure series, averaged over small blocks of pixels.

    Attributes
    ----------
    value : (pictures, blocks)
        Mean encoded value, 0..1.
    sd : (pictures, blocks)
        Standard deviation of ln(value).
    usable : (pictures, blocks) bool
        Neither dark nor saturated nor uneven, and so in two pictures at least.
    log_time : (pictures,)
        Logarithm of the exposure times.
    """

    value: Array
    sd: Array
    usable: Mask
    log_time: Array

    def without(self, picture: int) -> Series:
        """Return the series without one of its pictures."""
        keep = np.arange(len(self.log_time)) != picture
        return Series(
            self.value[keep], self.sd[keep], _paired(self.usable[keep]), self.log_time[keep]
        )

    @property
    def covered(self) -> tuple[float, float]:
        """Lowest and highest encoded value that has data (all but one block in 200)."""
        low, high = np.quantile(self.value[self.usable], [0.005, 0.995])
        return float(low), float(high)


def gather_series(channel: NDArray[np.float32], times_ms: Array, *, step: float) -> Series:
    """Average one channel of a series over blocks of pixels.

    Parameters
    ----------
    channel : (pictures, rows, columns)
        Encoded values 0..1.
    times_ms : (pictures,)
        Exposure times.
    step : float
        To which the values are rounded.
    """
    count, rows, columns = channel.shape
    side = max(2, round(np.sqrt(rows * columns / BLOCKS)))
    blocks = channel[:, : rows // side * side, : columns // side * side]
    blocks = blocks.reshape(count, rows // side, side, columns // side, side)
    blocks = blocks.transpose(0, 1, 3, 2, 4).reshape(count, -1, side * side).astype(np.float64)
    mean, spread = blocks.mean(axis=2), blocks.std(axis=2)
    usable = (blocks.min(axis=2) > 0.0) & (blocks.max(axis=2) < 1.0)
    usable &= spread <= LARGEST_SPREAD * mean
    safe = np.where(usable, mean, 1.0)
    # Rounding averages out only where noise carries the values over several steps.
    rounding = np.where(spread < step / 2.0, step / np.sqrt(12.0), 0.0)
    sd = np.hypot(spread / side, rounding) / safe
    return Series(safe, np.hypot(sd, REPEATABILITY), _paired(usable), np.log(times_ms))


def _paired(usable: Mask) -> Mask:
    return np.asarray(usable & (usable.sum(axis=0) >= 2))


def fit_exponents(series: Series) -> Array:
    """Return the local exponents at :data:`CORNERS` that explain a series best.

    Minimises the squared differences of ``ln light(value) - ln time`` between pictures of one
    block, each in units of its noise, with Tukey's biweight against dust and movement.
    """
    terms, log_time = _terms(series.value), series.log_time[:, None, None]
    outlier = np.ones_like(series.value)
    exponents = np.ones(len(CORNERS))
    steps = np.diff(np.eye(len(CORNERS)), axis=0) / EXPONENT_STEP
    for _ in range(ROUNDS):
        sd = series.sd * local_exponent(exponents, series.value)
        weight = np.where(series.usable, outlier / sd**2, 0.0)
        left = _centred(terms, weight)
        right = _centred(np.broadcast_to(log_time, weight[..., None].shape), weight)
        flat = (left * weight[..., None]).reshape(-1, len(CORNERS))
        normal = flat.T @ left.reshape(-1, len(CORNERS)) + steps.T @ steps
        root = np.linalg.cholesky(normal).T
        wanted = np.linalg.solve(root.T, flat.T @ right.ravel())
        bounds = (LEAST_EXPONENT, LARGEST_EXPONENT)
        exponents = np.asarray(lsq_linear(root, wanted, bounds=bounds).x)
        error = (left @ exponents - right[..., 0]) / sd
        scale = max(1.4826 * float(np.median(np.abs(error[series.usable]))), 1.0)
        outlier = np.clip(1.0 - (error / (TUKEY * scale)) ** 2, 0.0, None) ** 2
    return exponents


def light_of(exponents: Array, value: Array) -> Array:
    """Return the linear light of encoded values > 0, 1 at the end of the scale."""
    return np.asarray(np.exp(_terms(value) @ exponents))


def local_exponent(exponents: Array, value: Array) -> Array:
    """Return d(ln light)/d(ln value)."""
    return np.asarray(np.interp(np.log(value), np.log(CORNERS), exponents))


def disagreement(series: Series, exponents: Array) -> float:
    """Return by what share of the light the pictures disagree about their blocks (RMS)."""
    weight = np.where(series.usable, 1.0 / series.sd**2, 0.0)
    return _rms(_centred(_logs(series, exponents)[..., None], weight)[..., 0], weight)


def held_out_disagreement(series: Series, exponents: Array, picture: int) -> float:
    """Return by what share of the light a picture differs from what the others say (RMS).

    Parameters
    ----------
    series : Series
        Whole.
    exponents : (corners,)
        Fitted without the picture.
    picture : int
        Which; it is judged where its values lie within the others'. NaN where none do.
    """
    others = series.without(picture)
    if not others.usable.any():
        return float("nan")
    low, high = others.covered
    value, weight = series.value[picture], np.where(series.usable, 1.0 / series.sd**2, 0.0)
    own = np.where((value >= low) & (value <= high), weight[picture], 0.0)
    weight[picture] = 0.0
    total = weight.sum(axis=0)
    own[total == 0.0] = 0.0
    logs = _logs(series, exponents)
    mean = (weight * logs).sum(axis=0) / np.maximum(total, 1e-300)
    return _rms(logs[picture] - mean, own)


def _logs(series: Series, exponents: Array) -> Array:
    return np.asarray(_terms(series.value) @ exponents - series.log_time[:, None])


def _rms(error: Array, weight: Array) -> float:
    total = float(weight.sum())
    return float(np.sqrt((weight * error**2).sum() / total)) if total > 0.0 else float("nan")


def _terms(value: Array) -> Array:
    """Return the integrals (..., corners) from the end of the scale of each corner's share."""
    corners = np.log(CORNERS)
    knots = np.concatenate([corners[:1], corners, corners[-1:]])
    hats = BSpline(knots, np.eye(len(corners)), 1)
    place = np.log(value)
    inside = np.maximum(place, corners[0])
    whole = hats.antiderivative()
    terms = whole(inside) - whole(corners[-1])
    terms[..., 0] += place - inside  # below the lowest corner its exponent goes on
    return np.asarray(terms)


def _centred(values: Array, weight: Array) -> Array:
    """Return values (pictures, blocks, n) less their weighted mean over the pictures."""
    total = np.maximum(weight.sum(axis=0), 1e-300)
    mean = (values * weight[..., None]).sum(axis=0) / total[:, None]
    return np.asarray(values - mean)
