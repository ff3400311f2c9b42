"""Does a camera whose settings are locked really stand still? Judged on its own pictures."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.quality import QualityTable, judge
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

BANDS = 16
"""Bands of rows: light that flickers passes through a rolling shutter's picture as stripes."""
FRAMES = 30
SPAN_S = 3.0
"""An exposure that follows the light takes about a second to show it."""
DARKEST = 0.02
CHANNELS = ("red", "green", "blue")


def band_levels(rgb: NDArray[Any]) -> Array:
    """Return the mean of each band of a picture, (bands, 3), 0..1.

    Parameters
    ----------
    rgb : (height, width, 3) uint8 or uint16
        As the camera gave it.
    """
    full = 255.0 if rgb.dtype == np.uint8 else 65535.0
    # First across, then down: both are averages over areas, exact whatever the height.
    narrow = cv2.reduce(rgb, 1, cv2.REDUCE_AVG, dtype=cv2.CV_64F)
    edges = np.linspace(0, len(narrow), BANDS + 1).astype(int)
    bands = [narrow[first : max(last, first + 1), 0] for first, last in pairwise(edges)]
    means = np.stack([band.mean(axis=0) for band in bands])
    return np.asarray(means / full, np.float64)


def judge_steadiness(
    levels: NDArray[np.float64],
    times_s: NDArray[np.float64],
    *,
    rate_hz: float = 0.0,
    repeated: int = 0,
) -> QualityTable:
    """Judge how steady a camera is that looks at something that does not change.

    Parameters
    ----------
    levels : (frames, bands, 3) float64
        Of :func:`band_levels`.
    times_s : (frames,) float64
        When the frames came.
    rate_hz : float, optional
        The rate that the camera promised; 0 where it promised none.
    repeated : int, optional
        How many frames were the same as the one before, to the last bit.

    Raises
    ------
    ValueError
        If there are fewer than three frames, or not one time for each.
    """
    if levels.ndim != 3 or levels.shape[2] != 3 or len(levels) < 3:
        raise ValueError(f"levels have the shape (3 or more, bands, 3), not {levels.shape}")
    if times_s.shape != levels.shape[:1]:
        raise ValueError(f"{len(levels)} frames and times of the shape {times_s.shape}")
    whole = levels.mean(axis=1)
    bright = float(whole.mean())
    trend = _trend_percent(whole, times_s)
    even = float(trend.mean())
    figures = [
        judge(
            "camera_level",
            tr("Brightness of the picture"),
            100.0 * bright,
            "%",
            warn=100.0 * DARKEST,
            fail=0.4,
            higher_is_better=True,
            advice=tr("Switch the LEDs on, and lock with a longer exposure"),
        ),
        judge(
            "camera_drift_percent",
            tr("Drift of brightness during the test"),
            abs(even),
            "%",
            warn=0.5,
            fail=2.0,
            advice=tr("Lock exposure and gain, let the LEDs warm up for minutes, and test again"),
        ),
        judge(
            "camera_colour_drift_percent",
            tr("Drift of a colour by itself"),
            float(np.abs(trend - even).max()),
            "%",
            warn=0.5,
            fail=2.0,
            advice=tr("Lock the white balance, and test again"),
        ),
        judge(
            "camera_flicker_percent",
            tr("Flicker"),
            _flicker_percent(levels, times_s),
            "%",
            warn=0.4,
            fail=1.5,
            advice=tr("Shade the sensor from lamps, or expose for a multiple of 10 ms at 50 Hz"),
        ),
        judge(
            "camera_repeated",
            tr("Copies of the picture before"),
            100.0 * repeated / (len(levels) - 1),
            "%",
            warn=0.0,
            fail=50.0,
            advice=tr("The camera hangs: plug it in again, at another socket or without hub"),
        ),
    ]
    if rate_hz > 0.0:
        span_s = float(times_s[-1] - times_s[0])
        figures.append(
            judge(
                "camera_rate_percent",
                tr("Rate, of what was asked for"),
                100.0 * (len(times_s) - 1) / max(span_s, 1e-6) / rate_hz,
                "%",
                warn=85.0,
                fail=30.0,
                higher_is_better=True,
                advice=tr("Choose a shorter exposure or a lower rate; use a socket without hub"),
            )
        )
    return QualityTable(tuple(figures))


def _trend_percent(whole: Array, times_s: Array) -> Array:
    """Return how far each channel has come from begin to end, as a straight line, percent."""
    time = times_s - times_s.mean()
    slope = (time[:, None] * whole).sum(axis=0) / max(float((time**2).sum()), 1e-12)
    change = slope * float(times_s[-1] - times_s[0])
    return np.asarray(100.0 * change / np.maximum(whole.mean(axis=0), 1e-3))


def _flicker_percent(levels: Array, times_s: Array) -> float:
    """Return the root mean square of what is left of the bands' levels beside a straight line."""
    time = times_s - times_s.mean()
    slope = np.einsum("t,tbc->bc", time, levels) / max(float((time**2).sum()), 1e-12)
    left = levels - levels.mean(axis=0) - time[:, None, None] * slope
    share = left.std(axis=0) / np.maximum(levels.mean(axis=0), 1e-3)
    lit = levels.mean(axis=0) > 0.5 * DARKEST
    return float(100.0 * np.median(share[lit])) if lit.any() else 0.0
