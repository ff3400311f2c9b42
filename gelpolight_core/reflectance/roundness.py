"""Check that contacts of balls are round after the correction of lens, tilt and refraction."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from gelpolight_core.arrays import Array
from gelpolight_core.finding import Finding, judge
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import BallPress

LEAST_PRESSES = 4
SIGMAS = 3.0
"""Of a correct calibration, 1 in 370 is marked."""


def judge_roundness(presses: Sequence[BallPress], table: ResamplingTable) -> tuple[Finding, ...]:
    """Judge whether contacts are stretched, the more the nearer they are to the edge.

    A wrong index or thickness of a layer does: the error of the refracted ray grows with the
    square of the distance from the axis. The limit is the noise of the contacts. On the slope of a
    curved membrane, the drape makes contacts oval by as much: it is left out.

    Parameters
    ----------
    presses : sequence of BallPress
        With their contours on the grid of the table.
    table : ResamplingTable
        The correction.

    Returns
    -------
    tuple of Finding
        Empty with too few presses, or on a curved membrane.
    """
    axis_px = table.grid.to_index(np.zeros(2))
    offset_px = np.array([press.indentation.contour.mean(axis=0) - axis_px for press in presses])
    if len(presses) < LEAST_PRESSES or not offset_px.any() or not table.surface.flat:
        return ()
    share = (offset_px**2).sum(axis=1)
    share /= share.max()
    stretch = np.array(
        [_stretch(p.indentation.contour, a) for p, a in zip(presses, offset_px, strict=True)]
    )
    at_the_edge = float(share @ stretch) / float(share @ share)
    residual = stretch - at_the_edge * share
    sd = float(np.sqrt(residual @ residual / (len(share) - 1) / (share @ share)))
    return (
        judge(
            "contact_stretch_percent",
            "Contacts stretched towards the edge, after the correction of refraction",
            100.0 * abs(at_the_edge),
            "%",
            warn=100.0 * SIGMAS * sd,
            remedy="Check refractive index and thickness of the elastomer and the window",
        ),
    )


def _stretch(contour: Array, direction: Array) -> float:
    """Return the logarithm of a contour's extent along a direction over that across it."""
    _, (one, other), angle = cv2.fitEllipseDirect(contour.astype(np.float32).reshape(-1, 1, 2))
    angle_between = np.deg2rad(angle) - np.arctan2(direction[1], direction[0])
    return float(np.log(one / other) * np.cos(2.0 * angle_between))
