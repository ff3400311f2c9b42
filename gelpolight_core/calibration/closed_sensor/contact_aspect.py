"""Check that contacts of balls are round: where all are oval alike, pixels are not square."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid

DOUBTFUL_SIGMAS = 2.0
"""Round contacts look more oval in one of twenty calibrations."""


class ContactAspect(NamedTuple):
    """Common ratio of height to width of the contacts of balls.

    Attributes
    ----------
    log_ratio : float
        Logarithm of height over width.
    sd : float
        Its standard deviation.
    """

    log_ratio: float
    sd: float


def stretch_of(stretches: Sequence[tuple[float, ...]]) -> ContactAspect | None:
    """Return the common stretch of contacts.

    The edges measure it. The shading of the contacts underestimates it, but is affected less by the
    direction of the light: the difference of both shows the systematic error.

    Parameters
    ----------
    stretches : sequence of tuple of float
        Logarithm of height over width of each contact, by its edge and by its shading; others
        are left out.

    Returns
    -------
    Stretch or None
        None for fewer than 3 contacts.
    """
    pairs = np.array([pair for pair in stretches if len(pair) == 2 and np.isfinite(pair).all()])
    if len(pairs) < 3:
        return None
    edge, shading = np.median(pairs, axis=0)
    scatter = robust_sd(pairs[:, 0] - edge)
    # Of a median of normal values; and of one of two values that differ by so much.
    random_sd = scatter * np.sqrt(0.5 * np.pi / len(pairs))
    systematic_sd = (edge - shading) / np.sqrt(2)
    return ContactAspect(float(edge), float(np.hypot(random_sd, systematic_sd)))


def judge_stretch(stretch: ContactAspect | None, grid: WorkingGrid) -> tuple[Finding, ...]:
    """Judge whether the contacts are round with the stated size of the pixels.

    Parameters
    ----------
    stretch : ContactAspect or None
        As measured on the grid; nothing is judged without it.
    grid : WorkingGrid
        With the stated size of a pixel along x and y.
    """
    if stretch is None:
        return ()
    x, y = grid.pixel_mm
    ratio = float(np.exp(stretch.log_ratio))
    remedy = (
        f"The contacts are {ratio:.3f} \N{PLUS-MINUS SIGN} {ratio * stretch.sd:.3f} times as high "
        f"as wide: state mm_per_px = [{x:.5g}, {y / ratio:.5g}]"
    )
    return (
        judge(
            "contact_stretch_percent",
            "Difference between height and width of the contacts",
            100.0 * abs(stretch.log_ratio),
            "%",
            warn=DOUBTFUL_SIGMAS * 100.0 * stretch.sd,
            remedy=remedy,
        ),
    )
