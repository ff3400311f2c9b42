"""Check on a camera's own images that its locked settings really stay constant."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.finding import QualityTable, judge

Array = NDArray[np.float64]

BANDS = 16
"""Bands of rows: flickering light shows as stripes in the image of a rolling shutter."""
FRAMES = 30
SPAN_S = 3.0
"""Automatic exposure takes about a second to react."""
DARKEST = 0.02


def band_levels(rgb: NDArray[Any]) -> Array:
    """Return the mean of each band of an image, (bands, 3), 0..1.

    Parameters
    ----------
    rgb : (height, width, 3) uint8 or uint16
        As delivered by the camera.
    """
    full = 255.0 if rgb.dtype == np.uint8 else 65535.0
    # First across, then down: both are area averages, exact for any height.
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
    """Judge how steady a camera is while it views an unchanging scene.

    Parameters
    ----------
    levels : (frames, bands, 3) float64
        From :func:`band_levels`.
    times_s : (frames,) float64
        Arrival time of each frame.
    rate_hz : float, optional
        The requested frame rate; 0 if unknown.
    repeated : int, optional
        Number of frames that were identical to the previous one.

    Raises
    ------
    ValueError
        If there are fewer than three frames, or the number of times differs.
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
            "Image brightness",
            100.0 * bright,
            "%",
            warn=100.0 * DARKEST,
            fail=0.4,
            higher_is_better=True,
            remedy="Switch the LEDs on and lock a longer exposure",
        ),
        judge(
            "camera_drift_percent",
            "Brightness change during the test",
            abs(even),
            "%",
            warn=0.5,
            fail=2.0,
            remedy="Lock exposure and gain, let the LEDs warm up for a few minutes, and test again",
        ),
        judge(
            "camera_colour_drift_percent",
            "Change of one colour relative to the others",
            float(np.abs(trend - even).max()),
            "%",
            warn=0.5,
            fail=2.0,
            remedy="Lock the white balance, and test again",
        ),
        judge(
            "camera_flicker_percent",
            "Flicker",
            _flicker_percent(levels, times_s),
            "%",
            warn=0.4,
            fail=1.5,
            remedy=(
                "Shade the sensor from room lamps, or set the exposure to a multiple of 10 ms "
                "(50 Hz mains)"
            ),
        ),
        judge(
            "camera_repeated",
            "Repeated frames",
            100.0 * repeated / (len(levels) - 1),
            "%",
            warn=0.0,
            fail=50.0,
            remedy="The camera is stuck: reconnect it to another port, without a hub",
        ),
    ]
    if rate_hz > 0.0:
        span_s = float(times_s[-1] - times_s[0])
        figures.append(
            judge(
                "camera_rate_percent",
                "Frame rate, share of the requested rate",
                100.0 * (len(times_s) - 1) / max(span_s, 1e-6) / rate_hz,
                "%",
                warn=85.0,
                fail=30.0,
                higher_is_better=True,
                remedy=(
                    "Use a shorter exposure or a lower frame rate, and connect the camera "
                    "without a hub"
                ),
            )
        )
    return QualityTable(tuple(figures))


def _trend_percent(whole: Array, times_s: Array) -> Array:
    """Return the change of each channel from start to end, by a straight-line fit, percent."""
    time = times_s - times_s.mean()
    slope = (time[:, None] * whole).sum(axis=0) / max(float((time**2).sum()), 1e-12)
    change = slope * float(times_s[-1] - times_s[0])
    return np.asarray(100.0 * change / np.maximum(whole.mean(axis=0), 1e-3))


def _flicker_percent(levels: Array, times_s: Array) -> float:
    """Return the root mean square of the band levels about a straight line."""
    time = times_s - times_s.mean()
    slope = np.einsum("t,tbc->bc", time, levels) / max(float((time**2).sum()), 1e-12)
    left = levels - levels.mean(axis=0) - time[:, None, None] * slope
    share = left.std(axis=0) / np.maximum(levels.mean(axis=0), 1e-3)
    lit = levels.mean(axis=0) > 0.5 * DARKEST
    return float(100.0 * np.median(share[lit])) if lit.any() else 0.0
