"""The first stage: whether the camera's numbers are linear light, and if not, what makes them so.

A session may declare the camera's response, or hold a series of pictures of one still scene at
different exposures from which it is measured. What is measured is used, and what is declared is
then held against it. Where neither is given the camera is taken to be linear and nothing is done:
no other picture of a session tells a bent response from uneven light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.quality import Figure, QualityTable, judge
from gelpolight_core.response.curve import NODES, CameraResponse, declared_response, distance
from gelpolight_core.response.series import (
    REPEATABILITY,
    Series,
    disagreement,
    fit_exponents,
    gather_series,
    held_out_disagreement,
    light_of,
)
from gelpolight_core.session.picture import Picture
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

LEAST_PICTURES = 3
LEAST_SPAN = 4.0
# A picture with fewer blocks between dark and saturated adds nothing but its worst pixels.
LEAST_SHARE = 0.02
# Over a span of 4, light that repeats to 3 % leaves the exponent uncertain by 0.03 / ln 4 = 2 %;
# an exponent wrong by 5 % costs 4 % of depth.
WARN_RESIDUAL, LARGEST_RESIDUAL = 0.01, 0.03
# An exponent of 0.95 departs by 1.9 % of the scale and costs 4 % of depth, so that this costs half
# a percent, no more than the rest of a calibration leaves.
NEGLIGIBLE = 0.0025
SIGNIFICANT = 3.0
# As much as an exponent of 0.95: a curve known no better may cost more depth than it mends.
LARGEST_SD = 0.02
PLACES = 200


@dataclass(frozen=True, slots=True)
class ResponseResult:
    """What is known of the camera's response.

    Attributes
    ----------
    response : CameraResponse or None
        To be applied to every picture; None where the camera is linear.
    source : str
        ``undeclared``, ``declared`` or ``measured``.
    measured : CameraResponse or None
        What the pictures say, also where it is linear within the noise and left out.
    covered : (3, 2)
        Encoded values between which each channel was measured; 0 where it was not.
    quality : QualityTable
        Figures, limits and advice; empty where nothing was declared or measured.
    """

    response: CameraResponse | None
    source: str
    measured: CameraResponse | None
    covered: Array
    quality: QualityTable

    @property
    def summary(self) -> str:
        """What was done, in words."""
        if self.source == "undeclared":
            return tr("left out (nothing declared or measured: taken as linear)")
        if self.source == "declared":
            return tr("left out (declared linear)") if self.response is None else tr("as declared")
        if self.response is None:
            return tr("left out (measured: linear within the noise)")
        return tr("as measured")


def declare_response(declared: str | float | None) -> ResponseResult:
    """Return the result of a session without a series of exposures.

    Parameters
    ----------
    declared : str, float or None
        ``linear``, ``srgb``, a gamma, or None where nothing is declared.
    """
    response = declared_response(declared)
    figures: tuple[Figure, ...] = ()
    if response is not None:
        figures = (
            judge(
                "response_departure_percent",
                tr("Departure from linear, as declared"),
                100.0 * response.departure,
                "%",
            ),
        )
    source = "undeclared" if declared is None else "declared"
    return ResponseResult(response, source, None, np.zeros((3, 2)), QualityTable(figures))


def measure_response(
    pictures: Sequence[Picture],
    exposures_ms: Sequence[float],
    *,
    declared: str | float | None = None,
) -> ResponseResult:
    """Measure the response from pictures of one still, evenly lit scene.

    Parameters
    ----------
    pictures : sequence of Picture
        As the camera encodes them, all of one size.
    exposures_ms : sequence of float
        Exposure time of each.
    declared : str, float or None, optional
        What the session declares; only compared.

    Raises
    ------
    InputError
        If there are fewer than three different exposures or they span less than a factor of four
        (counting only pictures that are neither dark nor saturated), if they leave
        the curve uncertain or unchecked, or if the scene moved or its light changed.
    """
    times = np.asarray(exposures_ms, np.float64)
    _refuse_narrow(times, tr("there are {n} different exposures, over a factor of {r:.3g}"))
    step = 1.0 / (2.0 ** min(p.bit_depth for p in pictures) - 1.0)
    channels = []
    for k in range(3):
        stack = np.stack([p.rgb[..., k] for p in pictures])
        channels.append(_fit_channel(gather_series(stack, times, step=step)))
    measured = CameraResponse(np.stack([c.curve for c in channels]))
    residual = max(c.residual for c in channels)
    held_out = max(c.held_out for c in channels)
    _refuse_unsteady(max(residual, held_out))
    _refuse_unknown(max(float(c.departure_sd.max()) for c in channels))
    linear = all(c.linear for c in channels)
    return ResponseResult(
        None if linear else measured,
        "measured",
        measured,
        np.array([c.series.covered for c in channels]),
        _judge(channels, residual, held_out, declared),
    )


@dataclass(frozen=True, slots=True)
class _Channel:
    """One channel's fit, its departure from linear and that one's standard deviation."""

    series: Series
    curve: Array
    departure: Array
    departure_sd: Array
    residual: float
    held_out: float

    @property
    def linear(self) -> bool:
        limit = np.maximum(SIGNIFICANT * self.departure_sd, NEGLIGIBLE)
        return bool((np.abs(self.departure) <= limit).all())

    @property
    def places(self) -> Array:
        return np.linspace(*self.series.covered, PLACES)


def _fit_channel(series: Series) -> _Channel:
    series = _lit_pictures(series)
    count = len(series.log_time)
    exponents = fit_exponents(series)
    places = np.linspace(*series.covered, PLACES)
    straight = distance(light_of(exponents, places), places)
    held_out = [held_out_disagreement(series, picture) for picture in range(count)]
    known = [value for value in held_out if np.isfinite(value)]
    if not known:
        raise InputError(
            tr("no exposure can be checked by the others: no place is well exposed in three"),
            where="response",
            advice=tr("Add exposures in between"),
        )
    # Exposures that are not quite what is stated bend the curve more than pixels' noise does.
    doubt = max(REPEATABILITY, float(np.median(known)))
    variance = np.zeros(PLACES)
    for disturbance in doubt * np.eye(count):
        fitted = fit_exponents(replace(series, log_time=series.log_time + disturbance))
        variance += (distance(light_of(fitted, places), places) - straight) ** 2
    return _Channel(
        series,
        _as_curve(exponents),
        straight,
        np.sqrt(variance),
        disagreement(series, exponents),
        max(known),
    )


def _as_curve(exponents: Array) -> Array:
    nodes = np.linspace(0.0, 1.0, NODES)
    curve = np.concatenate([[0.0], light_of(exponents, nodes[1:])])
    curve[-1] = 1.0
    return curve


def _lit_pictures(series: Series) -> Series:
    """Leave out the pictures of a series that are dark or saturated nearly everywhere."""
    lit = series.usable.mean(axis=1) >= LEAST_SHARE
    _refuse_narrow(
        np.exp(series.log_time[lit]),
        tr(
            "only {n} different exposures are neither dark, saturated nor noise, over a factor of "
            "{r:.3g}"
        ),
    )
    for picture in np.flatnonzero(~lit)[::-1]:
        series = series.without(int(picture))
    return series


def _refuse_narrow(times_ms: Array, found: str) -> None:
    count = np.unique(times_ms).size
    span = float(times_ms.max() / times_ms.min()) if count else 0.0
    # Stated times are rounded: 0.5 to 2.0 ms is a factor of four.
    if count < LEAST_PICTURES or span < LEAST_SPAN * (1.0 - 1e-6):
        raise InputError(
            found.format(n=count, r=span),
            where="response",
            advice=tr(
                "Capture one still, evenly lit scene at {n} exposures or more, the longest {r:g} "
                "times the shortest or more, neither black nor saturated"
            ).format(n=LEAST_PICTURES, r=LEAST_SPAN),
        )


def _refuse_unsteady(residual: float) -> None:
    if residual > LARGEST_RESIDUAL:
        raise InputError(
            tr("the pictures disagree by {x:.1%} of their light").format(x=residual),
            where="response",
            advice=tr(
                "Capture the series again with a still scene, steady light and the lens untouched, "
                "state each picture's true exposure time, and switch off automatic gain and "
                "white balance"
            ),
        )


def _refuse_unknown(departure_sd: float) -> None:
    if departure_sd > LARGEST_SD:
        raise InputError(
            tr("the pictures leave the curve uncertain by {x:.1%} of the scale").format(
                x=departure_sd
            ),
            where="response",
            advice=tr(
                "Add exposures in between, or show a scene with some places twice as bright "
                "as others"
            ),
        )


def _judge(
    channels: Sequence[_Channel], residual: float, held_out: float, declared: str | float | None
) -> QualityTable:
    worst = max(channels, key=lambda c: float(np.abs(c.departure).max()))
    times = np.exp(channels[0].series.log_time)
    figures = [
        judge(
            "response_departure_percent",
            tr("Departure from linear, worst channel"),
            100.0 * float(np.abs(worst.departure).max()),
            "%",
        ),
        judge(
            "response_departure_sd_percent",
            tr("Departure from linear, standard deviation"),
            100.0 * max(float(c.departure_sd.max()) for c in channels),
            "%",
            warn=0.5,
            fail=100.0 * LARGEST_SD,
            advice=tr("Add exposures, and check that their times are true"),
        ),
        judge(
            "response_residual_percent",
            tr("Disagreement of the exposures about the light, beyond noise"),
            100.0 * residual,
            "%",
            warn=100.0 * WARN_RESIDUAL,
            fail=100.0 * LARGEST_RESIDUAL,
            advice=tr("Keep scene and light still, and check the exposure times"),
        ),
        judge(
            "response_held_out_percent",
            tr("Disagreement of an exposure held out, worst, beyond noise"),
            100.0 * held_out,
            "%",
            warn=100.0 * WARN_RESIDUAL,
            fail=100.0 * LARGEST_RESIDUAL,
            advice=tr("Keep scene and light still, check the exposure times, add exposures"),
        ),
        judge(
            "response_lowest_percent",
            tr("Scale covered, from"),
            100.0 * max(c.series.covered[0] for c in channels),
            "%",
            warn=30.0,
            advice=tr("Add shorter exposures"),
        ),
        judge(
            "response_highest_percent",
            tr("Scale covered, to"),
            100.0 * min(c.series.covered[1] for c in channels),
            "%",
            warn=80.0,
            higher_is_better=True,
            advice=tr("Add longer exposures, up to where the scene begins to saturate"),
        ),
        judge(
            "response_exposure_span",
            tr("Longest over shortest exposure used"),
            float(times.max() / times.min()),
        ),
    ]
    if declared is not None:
        figures.append(_declared_figure(channels, declared))
    return QualityTable(tuple(figures))


def _declared_figure(channels: Sequence[_Channel], declared: str | float) -> Figure:
    response, nodes = declared_response(declared), np.linspace(0.0, 1.0, NODES)
    stated = np.tile(nodes, (3, 1)) if response is None else response.curves
    difference = 0.0
    for channel, curve in zip(channels, stated, strict=True):
        light, said = (np.interp(channel.places, nodes, c) for c in (channel.curve, curve))
        difference = max(difference, float(np.abs(distance(light, said)).max()))
    return judge(
        "response_declared_difference_percent",
        tr("Declared response less the measured one (which is used)"),
        100.0 * difference,
        "%",
        warn=1.0,
        advice=tr(
            "Correct or remove what is declared of the camera; the measured response was used"
        ),
    )
