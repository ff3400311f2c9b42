"""The stage of the camera response: check that pixel values are linear light, or find the curve.

A session may declare the camera response, or contain a series of images of one still scene at
different exposures. A measured response is used, and a declared one is then only compared with it.
If there is neither, the camera is assumed to be linear: no other image of a session can distinguish
a non-linear response from uneven light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.image.response import NODES, CameraResponse, curve_distance, declared_response

from .exposure_series import (
    REPEATABILITY,
    ExposureSeries,
    disagreement,
    fit_exponents,
    gather_series,
    held_out_disagreement,
    linear_light,
)

LEAST_IMAGES = 3
LEAST_SPAN = 4.0
# An image with fewer blocks between dark and saturated adds only its worst pixels.
LEAST_SHARE = 0.02
# Over a factor of 4, light that repeats to 3 % leaves the exponent uncertain by 0.03 / ln 4 = 2 %;
# an exponent wrong by 5 % causes a depth error of 4 %.
WARN_RESIDUAL, LARGEST_RESIDUAL = 0.01, 0.03
# An exponent of 0.95 deviates by 1.9 % of full scale and causes a depth error of 4 %, so this limit
# costs half a percent, no more than the rest of a calibration.
NEGLIGIBLE = 0.0025
SIGNIFICANT = 3.0
# As much as an exponent of 0.95: a curve known less well may do more harm than good.
LARGEST_SD = 0.02
PLACES = 200


@dataclass(frozen=True, slots=True)
class ResponseResult:
    """Result of the stage of the camera response.

    Attributes
    ----------
    response : CameraResponse or None
        Applied to every image; None if the camera is linear.
    source : str
        ``undeclared``, ``declared`` or ``measured``.
    measured : CameraResponse or None
        The measured curve, even if it is linear within the noise and therefore not applied.
    covered : (3, 2)
        Range of encoded values in which each channel was measured; 0 if it was not.
    quality : QualityTable
        Figures, limits and advice; empty if nothing was declared or measured.
    """

    response: CameraResponse | None
    source: str
    measured: CameraResponse | None
    covered: Float64Array
    quality: QualityTable

    @property
    def summary(self) -> str:
        """Short description of the result."""
        if self.source == "undeclared":
            return "not applied (nothing declared or measured: assumed linear)"
        if self.source == "declared":
            return "not applied (declared linear)" if self.response is None else "as declared"
        if self.response is None:
            return "not applied (measured: linear within the noise)"
        return "as measured"


def declare_response(declared: str | float | None) -> ResponseResult:
    """Return the result of a session without a series of exposures.

    Parameters
    ----------
    declared : str, float or None
        ``linear``, ``srgb``, a gamma, or None if nothing is declared.
    """
    response = declared_response(declared)
    figures: tuple[Finding, ...] = ()
    if response is not None:
        figures = (
            judge(
                "response_departure_percent",
                "Declared response, deviation from linear",
                100.0 * response.departure,
                "%",
            ),
        )
    source = "undeclared" if declared is None else "declared"
    return ResponseResult(response, source, None, np.zeros((3, 2)), QualityTable(figures))


def measure_response(
    images: Sequence[LinearImage],
    exposures_ms: Sequence[float],
    *,
    declared: str | float | None = None,
) -> ResponseResult:
    """Measure the response from images of one still, evenly lit scene.

    Parameters
    ----------
    images : sequence of LinearImage
        As encoded by the camera, all of the same size.
    exposures_ms : sequence of float
        Exposure time of each.
    declared : str, float or None, optional
        Response declared by the session; only compared.

    Raises
    ------
    InputError
        If there are fewer than three different exposures or they span less than a factor of four
        (counting only images that are neither dark nor saturated), if the curve stays uncertain or
        cannot be checked, or if the scene moved or its light changed.
    """
    times = np.asarray(exposures_ms, np.float64)
    _refuse_narrow(times, "There are only {n} different exposures over a factor of {r:.3g}")
    step = 1.0 / (2.0 ** min(p.bit_depth for p in images) - 1.0)
    channels = []
    for k in range(3):
        stack = np.stack([p.rgb[..., k] for p in images])
        channels.append(_fit_channel(gather_series(stack, times, step=step)))
    measured = CameraResponse(np.stack([c.curve for c in channels]))
    residual = max(c.residual for c in channels)
    held_out = max(c.held_out for c in channels)
    if max(residual, held_out) > LARGEST_RESIDUAL:
        text = f"The images disagree by {max(residual, held_out):.1%} of their light"
        raise InputError(text, "response", Remedy.STEADY_SERIES)
    if (sd := max(float(c.departure_sd.max()) for c in channels)) > LARGEST_SD:
        text = f"The response curve is uncertain by {sd:.1%} of full scale"
        raise InputError(text, "response", Remedy.MORE_EXPOSURES)
    linear = all(c.linear for c in channels)
    return ResponseResult(
        None if linear else measured,
        "measured",
        measured,
        np.array([c.series.covered for c in channels]),
        _judge(channels, residual, held_out, declared),
    )


@dataclass(frozen=True, slots=True)
class _ChannelFit:
    """Fit of one channel, its deviation from linear and the standard deviation of that."""

    series: ExposureSeries
    curve: Float64Array
    departure: Float64Array
    departure_sd: Float64Array
    residual: float
    held_out: float

    @property
    def linear(self) -> bool:
        limit = np.maximum(SIGNIFICANT * self.departure_sd, NEGLIGIBLE)
        return bool((np.abs(self.departure) <= limit).all())

    @property
    def values(self) -> Float64Array:
        return np.linspace(*self.series.covered, PLACES)


def _fit_channel(series: ExposureSeries) -> _ChannelFit:
    series = _lit_images(series)
    count = len(series.log_time)
    exponents = fit_exponents(series)
    values = np.linspace(*series.covered, PLACES)
    straight = curve_distance(linear_light(exponents, values), values)
    held_out = [held_out_disagreement(series, image) for image in range(count)]
    finite = [value for value in held_out if np.isfinite(value)]
    if not finite:
        text = (
            "No exposure can be checked against the others: no part of the scene is well exposed "
            "in three images"
        )
        raise InputError(text, "response", Remedy.MORE_EXPOSURES)
    # Small errors of the stated exposure times bend the curve more than pixel noise does.
    uncertainty = max(REPEATABILITY, float(np.median(finite)))
    variance = np.zeros(PLACES)
    for disturbance in uncertainty * np.eye(count):
        fitted = fit_exponents(replace(series, log_time=series.log_time + disturbance))
        variance += (curve_distance(linear_light(fitted, values), values) - straight) ** 2
    curve = np.concatenate([[0.0], linear_light(exponents, np.linspace(0.0, 1.0, NODES)[1:])])
    curve[-1] = 1.0
    residual = disagreement(series, exponents)
    return _ChannelFit(series, curve, straight, np.sqrt(variance), residual, max(finite))


def _lit_images(series: ExposureSeries) -> ExposureSeries:
    """Leave out the images of a series that are dark or saturated nearly everywhere."""
    lit = series.usable.mean(axis=1) >= LEAST_SHARE
    text = (
        "Only {n} different exposures over a factor of {r:.3g} are usable (not dark, saturated or "
        "noisy)"
    )
    _refuse_narrow(np.exp(series.log_time[lit]), text)
    for image in np.flatnonzero(~lit)[::-1]:
        series = series.without(int(image))
    return series


def _refuse_narrow(times_ms: Float64Array, text: str) -> None:
    count = np.unique(times_ms).size
    span = float(times_ms.max() / times_ms.min()) if count else 0.0
    # Stated times are rounded: 0.5 to 2.0 ms is a factor of four.
    if count < LEAST_IMAGES or span < LEAST_SPAN * (1.0 - 1e-6):
        raise InputError(text.format(n=count, r=span), "response", Remedy.MORE_EXPOSURES)


def _judge(
    channels: Sequence[_ChannelFit], residual: float, held_out: float, declared: str | float | None
) -> QualityTable:
    worst = max(channels, key=lambda c: float(np.abs(c.departure).max()))
    times = np.exp(channels[0].series.log_time)
    figures = [
        judge(
            "response_departure_percent",
            "Deviation from linear, worst channel",
            100.0 * float(np.abs(worst.departure).max()),
            "%",
        ),
        judge(
            "response_departure_sd_percent",
            "Deviation from linear, standard deviation",
            100.0 * max(float(c.departure_sd.max()) for c in channels),
            "%",
            warn=0.5,
            fail=100.0 * LARGEST_SD,
            remedy="Add exposures, and check the stated exposure times",
        ),
        judge(
            "response_residual_percent",
            "Disagreement between exposures, beyond noise",
            100.0 * residual,
            "%",
            warn=100.0 * WARN_RESIDUAL,
            fail=100.0 * LARGEST_RESIDUAL,
            remedy="Keep scene and light constant, and check the exposure times",
        ),
        judge(
            "response_held_out_percent",
            "Disagreement of a held-out exposure, worst case, beyond noise",
            100.0 * held_out,
            "%",
            warn=100.0 * WARN_RESIDUAL,
            fail=100.0 * LARGEST_RESIDUAL,
            remedy="Keep scene and light constant, check the exposure times, and add exposures",
        ),
        judge(
            "response_lowest_percent",
            "Measured range, lower end",
            100.0 * max(c.series.covered[0] for c in channels),
            "%",
            warn=30.0,
            remedy="Add shorter exposures",
        ),
        judge(
            "response_highest_percent",
            "Measured range, upper end",
            100.0 * min(c.series.covered[1] for c in channels),
            "%",
            warn=80.0,
            higher_is_better=True,
            remedy="Add longer exposures, until the scene begins to saturate",
        ),
        judge(
            "response_exposure_span",
            "Ratio of longest to shortest exposure used",
            float(times.max() / times.min()),
        ),
    ]
    if declared is not None:
        figures.append(_declared_figure(channels, declared))
    return QualityTable(tuple(figures))


def _declared_figure(channels: Sequence[_ChannelFit], declared: str | float) -> Finding:
    response, nodes = declared_response(declared), np.linspace(0.0, 1.0, NODES)
    declared_curves = np.tile(nodes, (3, 1)) if response is None else response.curves
    difference = 0.0
    for channel, curve in zip(channels, declared_curves, strict=True):
        light, expected = (np.interp(channel.values, nodes, c) for c in (channel.curve, curve))
        difference = max(difference, float(np.abs(curve_distance(light, expected)).max()))
    return judge(
        "response_declared_difference_percent",
        "Declared response minus measured response (the measured one is used)",
        100.0 * difference,
        "%",
        warn=1.0,
        remedy="Correct or remove the declared camera response; the measured response was used",
    )
