"""Fit a camera's inverse response to images of one still scene at different exposures.

The local exponent d(ln light)/d(ln value) is a piecewise linear function of the value: 1 everywhere
for a linear camera, 2.2 everywhere for a gamma of 2.2. Its integral is linear in the corner values
and increases as long as they are positive. The light of each point in the scene is eliminated in
closed form, so the fit is one small bounded least-squares problem per channel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.robust import TUKEY, robust_sd, tukey_weights

# Denser at small values, where most camera curves bend.
CORNERS = (np.arange(1, 13) / 12.0) ** 2
_LOG_CORNERS = np.log(CORNERS)
_GAPS = np.diff(_LOG_CORNERS)
LEAST_EXPONENT, LARGEST_EXPONENT = 0.05, 20.0
# From corner to corner the exponent of sRGB changes by 0.1 on average and by 0.4 at most; without
# data, the exponent is expected to change by this.
EXPONENT_STEP = 0.2
# Shutters and lamps repeat to about this share of the light.
REPEATABILITY = 0.003
BLOCKS = 1200
# A block with a larger spread of values contains an edge or mostly noise. Noise that passed through
# a curve is no longer centred (0.15 % off at this limit and a gamma of 2.2).
LARGEST_SPREAD = 0.05
ROUNDS = 10


@dataclass(frozen=True, slots=True)
class ExposureSeries:
    """One channel of an exposure series, averaged over small blocks of pixels.

    Attributes
    ----------
    value : (images, blocks)
        Mean encoded value, 0..1.
    noise : (images, blocks)
        Standard deviation of ln(value) from the pixels' noise and rounding.
    usable : (images, blocks) bool
        Neither dark nor saturated nor uneven, in at least two images.
    log_time : (images,)
        Natural logarithm of the exposure times.
    """

    value: Float64Array
    noise: Float64Array
    usable: BoolArray
    log_time: Float64Array

    def without(self, image: int) -> ExposureSeries:
        """Return the series without one of its images."""
        keep = np.arange(len(self.log_time)) != image
        return ExposureSeries(
            self.value[keep], self.noise[keep], _paired(self.usable[keep]), self.log_time[keep]
        )

    @property
    def covered(self) -> tuple[float, float]:
        """Lowest and highest encoded value with data (for all but one block in 200)."""
        low, high = np.quantile(self.value[self.usable], [0.005, 0.995])
        return float(low), float(high)


def gather_series(channel: Float32Array, times_ms: Float64Array, *, step: float) -> ExposureSeries:
    """Average one channel of a series over blocks of pixels.

    Parameters
    ----------
    channel : (images, rows, columns)
        Encoded values 0..1.
    times_ms : (images,)
        Exposure times.
    step : float
        Rounding step of the values.
    """
    count, rows, columns = channel.shape
    side = 2 * max(1, round(np.sqrt(rows * columns / BLOCKS) / 2.0))
    blocks = channel[:, : rows // side * side, : columns // side * side].astype(np.float64)
    blocks = blocks.reshape(count, rows // side, side, columns // side, side)
    blocks = blocks.transpose(0, 1, 3, 2, 4).reshape(count, -1, side, side)
    mean, sd = blocks.mean(axis=(2, 3)), blocks.std(axis=(2, 3))
    # The checkerboard difference of 2x2 pixels does not contain the shading of the scene.
    row_difference = blocks[:, :, ::2] - blocks[:, :, 1::2]
    checkered = (row_difference[..., ::2] - row_difference[..., 1::2]) / 2.0
    pixel_noise = np.sqrt((checkered**2).mean(axis=(2, 3)))
    usable = (blocks.min(axis=(2, 3)) > 0.0) & (blocks.max(axis=(2, 3)) < 1.0)
    # Without noise that spreads the values over several steps, a uniform scene is rounded the same
    # everywhere and nothing averages out.
    # With noise of 0.28 steps (0.4 with the rounding itself) the mean is wrong by up to 0.07 steps.
    rounding = np.where(pixel_noise < 0.4 * step, step / 2.0, 0.0)
    usable &= np.hypot(sd, rounding) <= LARGEST_SPREAD * mean
    safe = np.where(usable, mean, 1.0)
    noise = np.hypot(pixel_noise / side, rounding) / safe
    return ExposureSeries(safe, noise, _paired(usable), np.log(times_ms))


def _paired(usable: BoolArray) -> BoolArray:
    return np.asarray(usable & (usable.sum(axis=0) >= 2))


def fit_exponents(series: ExposureSeries) -> Float64Array:
    """Return the local exponents at :data:`CORNERS` that explain a series best.

    Minimises the squared differences between the measured values and those predicted from one light
    per block and the exposure times, in units of their noise, with Tukey's biweight against dust
    and movement. The curve is evaluated at the predicted values, not at the noisy ones: noise in
    its argument would flatten the curve where a scene is uniform.
    """
    log_time, log_value = series.log_time[:, None, None], np.log(series.value)
    outlier = np.ones_like(log_value)
    steps = np.diff(np.eye(len(CORNERS)), axis=0) / EXPONENT_STEP
    # Far wider than for any camera, so that images without information leave it at about 1.
    expected = np.eye(len(CORNERS)) / 100.0
    # In a uniform scene only noise distinguishes the blocks: it must not decide the start value.
    exponents = np.full(len(CORNERS), _single_exponent(series))
    clean = _led_to(series, exponents, outlier)
    for number in range(ROUNDS):
        slope = np.interp(clean, np.log(CORNERS), exponents)
        weight = outlier * _weight(series, slope)
        design = _centred(_terms(clean), weight)
        remaining = log_time - (slope * (log_value - clean))[..., None]
        target = _centred(remaining, weight)
        flat = (design * weight[..., None]).reshape(-1, len(CORNERS))
        normal = flat.T @ design.reshape(-1, len(CORNERS)) + steps.T @ steps + expected
        root = np.linalg.cholesky(normal).T
        bounds = (LEAST_EXPONENT, LARGEST_EXPONENT)
        goal = np.linalg.solve(root.T, flat.T @ target.ravel() + expected.sum(axis=1))
        exponents = np.asarray(lsq_linear(root, goal, bounds=bounds).x)
        clean = _led_to(series, exponents, outlier)
        slope = np.interp(clean, np.log(CORNERS), exponents)
        # Before the curve has found its shape, whole images would look like outliers.
        if number < 4:
            continue
        error = slope * (log_value - clean) * np.sqrt(_weight(series, slope))
        scale = max(robust_sd(error[series.usable]), 1.0)
        outlier = tukey_weights(error, TUKEY * scale)
    return exponents


def _single_exponent(series: ExposureSeries) -> float:
    """Return the exponent of the power law that fits a series best."""
    weight = _weight(series, np.ones_like(series.value))[..., None]
    value = _centred(np.log(series.value)[..., None], weight[..., 0])
    time = _centred(np.broadcast_to(series.log_time[:, None, None], value.shape), weight[..., 0])
    exponent = (weight * value * time).sum() / max(float((weight * value**2).sum()), 1e-300)
    return float(np.clip(exponent, LEAST_EXPONENT, LARGEST_EXPONENT))


def _led_to(series: ExposureSeries, exponents: Float64Array, outlier: Float64Array) -> Float64Array:
    """Return ln(value) predicted from each block's light over all images, at each time."""
    weight = outlier * _weight(series, local_exponent(exponents, series.value))
    total = np.maximum(weight.sum(axis=0), 1e-300)
    light = (weight * _logs(series, exponents)).sum(axis=0) / total + series.log_time[:, None]
    log_values = np.linspace(np.log(CORNERS[0]) - 4.0, 0.0, 2000)
    return np.asarray(np.interp(light, _log_light(log_values, exponents), log_values))


def linear_light(exponents: Float64Array, value: Float64Array) -> Float64Array:
    """Return the linear light of encoded values > 0, with 1 at full scale."""
    return np.asarray(np.exp(_log_light(np.log(value), exponents)))


def local_exponent(exponents: Float64Array, value: Float64Array) -> Float64Array:
    """Return d(ln light)/d(ln value)."""
    return np.asarray(np.interp(np.log(value), np.log(CORNERS), exponents))


def disagreement(series: ExposureSeries, exponents: Float64Array) -> float:
    """Return the disagreement of the images about their blocks, as a share of the light.

    The root mean square, with the part explained by pixel noise removed.
    """
    noise, weight = _light_noise(series, exponents)
    error = _centred(_logs(series, exponents)[..., None], weight)[..., 0]
    remaining_share = 1.0 - weight / np.maximum(weight.sum(axis=0), 1e-300)
    return _excess(error, noise * np.sqrt(remaining_share), weight)


def held_out_disagreement(series: ExposureSeries, image: int) -> float:
    """Return the difference of an image from the others' prediction, as a share of the light.

    The root mean square, with the part explained by pixel noise removed, over the values within the
    range of the others; NaN if there are none.
    """
    others = series.without(image)
    if not others.usable.any():
        return float("nan")
    exponents, (low, high) = fit_exponents(others), others.covered
    value, (noise, weight) = series.value[image], _light_noise(series, exponents)
    held_out_weight = np.where((value >= low) & (value <= high), weight[image], 0.0)
    weight[image] = 0.0
    total = weight.sum(axis=0)
    held_out_weight[total == 0.0] = 0.0
    logs = _logs(series, exponents)
    mean = (weight * logs).sum(axis=0) / np.maximum(total, 1e-300)
    return _excess(logs[image] - mean, noise[image], held_out_weight)


def _logs(series: ExposureSeries, exponents: Float64Array) -> Float64Array:
    return _log_light(np.log(series.value), exponents) - series.log_time[:, None]


def _light_noise(
    series: ExposureSeries, exponents: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the standard deviation of ln(light) from pixel noise with each block's weight."""
    slope = local_exponent(exponents, series.value)
    return series.noise * slope, _weight(series, slope)


def _weight(series: ExposureSeries, slope: Float64Array) -> Float64Array:
    light_variance = (series.noise * slope) ** 2 + REPEATABILITY**2
    return np.where(series.usable, 1.0 / light_variance, 0.0)


def _excess(error: Float64Array, noise: Float64Array, weight: Float64Array) -> float:
    total = float(weight.sum())
    excess = float((weight * (error**2 - noise**2)).sum())
    return float(np.sqrt(max(excess, 0.0) / total)) if total > 0.0 else float("nan")


def _terms(log_value: Float64Array) -> Float64Array:
    """Return the integrals (..., corners) of each corner's share, from ln(value) = 0."""
    below, along, bent = _within(log_value)
    terms = _TERMS_AT_CORNERS[below]
    flat, rows = terms.reshape(-1, len(CORNERS)), np.arange(below.size)
    flat[rows, below.ravel()] += (along - bent).ravel()
    flat[rows, below.ravel() + 1] += bent.ravel()
    return np.asarray(terms)


def _log_light(log_value: Float64Array, exponents: Float64Array) -> Float64Array:
    """Return ln(light) at ln(value): ``_terms(log_value) @ exponents``, at a lower cost."""
    below, along, bent = _within(log_value)
    at_corners = _TERMS_AT_CORNERS @ exponents
    rise = np.diff(exponents)
    return np.asarray(at_corners[below] + along * exponents[below] + bent * rise[below])


def _within(log_value: Float64Array) -> tuple[NDArray[np.intp], Float64Array, Float64Array]:
    """Return the corner below each value, the distance from it and the distance's integral.

    Below the lowest corner its exponent continues; the highest corner is 0, where values end.
    """
    below = np.clip(np.searchsorted(_LOG_CORNERS, log_value) - 1, 0, len(CORNERS) - 2)
    along = log_value - _LOG_CORNERS[below]
    return below, along, 0.5 * along * np.maximum(along, 0.0) / _GAPS[below]


def _terms_at_corners() -> Float64Array:
    """Return :func:`_terms` at the corners themselves, by the trapezoidal rule."""
    halves = 0.5 * _GAPS[:, None] * (np.eye(len(CORNERS))[1:] + np.eye(len(CORNERS))[:-1])
    from_lowest = np.concatenate([np.zeros((1, len(CORNERS))), np.cumsum(halves, axis=0)])
    return np.asarray(from_lowest - from_lowest[-1])


def _centred(values: Float64Array, weight: Float64Array) -> Float64Array:
    """Return values (images, blocks, n) less their weighted mean over the images."""
    total = np.maximum(weight.sum(axis=0), 1e-300)
    mean = (values * weight[..., None]).sum(axis=0) / total[:, None]
    return np.asarray(values - mean)


_TERMS_AT_CORNERS = _terms_at_corners()
