"""The background against the untouched part of the ball images.

What a ball does not touch must look as in the background, except for light that is common to the
whole field. What differs in the same way in every image is wrong in the background.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import SD_OF_MEDIAN, robust_sd
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.reconstruction.near_light.sensor_maps import block_average
from gelpolight_core.stages.balls.ball_press import LEAST_VALUE, BallPress
from gelpolight_core.stages.balls.indentation_checks import DETECTION

from .ball_pixels import DRAPE_WIDTH_MM

WARN_PERCENT, FAIL_PERCENT = 2.0, 4.0
"""Errors of heights, of a press 1 mm deep; the larger one is half of that of the paper's method."""
HEIGHT_BY_LIGHT = 4.5
"""Relative change of a height by that of all light. The slope beside a step of 1 % of that press
changes the light there by 1 %."""
CELL_MM, ROUNDS = 0.5, 5


def mean_light_of_cells(
    image: Float32Array, table: ResamplingTable, press: BallPress | None = None
) -> Float32Array:
    """Return the mean light of each cell, (rows, columns, 3), NaN where unknown or touched.

    Parameters
    ----------
    image : (rows, columns, 3) float32
        On the grid.
    table : ResamplingTable
        The grid and its rays.
    press : BallPress, optional
        What is pressed in; without it all of the image counts.
    """
    grid = table.grid
    valid = table.valid & (image > LEAST_VALUE).all(axis=2) & (image < SATURATED).all(axis=2)
    if press is not None:
        # At twice the width of the drape that the calibration uses, its slope is 1 %.
        reach_mm = press.contact_radius_mm + 2.0 * DRAPE_WIDTH_MM
        x_mm, y_mm = press.pose.centre_mm
        valid &= np.hypot(grid.x_mm - x_mm, grid.y_mm[:, None] - y_mm) > reach_mm
    return block_average(np.where(valid[..., None], image, np.float32(np.nan)), cell_nodes(table))


def cell_nodes(table: ResamplingTable) -> int:
    """Return the nodes of a cell along an axis."""
    return max(round(CELL_MM / table.grid.pitch_mm), 1)


def judge_background(
    background: Float32Array, images: Sequence[Float32Array], table: ResamplingTable
) -> tuple[Finding, ...]:
    """Judge the background by what all images of presses show.

    Parameters
    ----------
    background, images : (rows, columns, 3) float32
        Cells.
    table : ResamplingTable
        The grid.

    Returns
    -------
    tuple of Finding
        Empty with fewer than two images: one alone cannot tell which of the two is wrong.
    """
    fitted = np.array([_common_and_left(background, image) for image in images])
    # Light that is known in two images.
    often = np.isfinite(fitted).all(axis=(1, 4)).sum(axis=0) > 1 if len(fitted) else np.zeros(0)
    if not often.any():
        return ()
    common, residual = fitted[:, 0, often], fitted[:, 1, often]
    level = background[often]
    light = np.sqrt(np.mean(np.nanmedian(common, axis=0) ** 2, axis=0)).max()
    noise = SD_OF_MEDIAN * np.median(np.abs(np.nanmedian(residual, axis=0) * level), axis=0) / level
    # What differs also in the image that agrees best.
    low, high = np.nanmin(residual, axis=0), np.nanmax(residual, axis=0)
    smallest = np.maximum(low, 0.0) + np.minimum(high, 0.0)
    clear = np.maximum(np.abs(smallest) - DETECTION * noise, 0.0).max(axis=1)
    cell_mm = cell_nodes(table) * table.grid.pitch_mm
    row, column = cell_mm * (np.argwhere(often)[clear.argmax()] + 0.5)
    return (
        judge(
            "background_light_percent",
            "Light of the ball presses against the background",
            100.0 * float(light),
            "%",
            warn=WARN_PERCENT / HEIGHT_BY_LIGHT,
            fail=FAIL_PERCENT / HEIGHT_BY_LIGHT,
            remedy=(
                "Exposure, LEDs or room light changed between background and ball presses:"
                " capture both again without a change"
            ),
        ),
        judge(
            "background_place_percent",
            "Background against the untouched membrane of the ball presses, worst place",
            100.0 * float(clear.max()),
            "%",
            warn=WARN_PERCENT,
            fail=FAIL_PERCENT,
            remedy=(
                "Something touched the membrane or lay on it at "
                f"x {table.grid.x_mm[0] + column:.1f}, "
                f"y {table.grid.y_mm[0] + row:.1f} mm in the"
                " background: clean the membrane and capture the background again"
            ),
        ),
    )


def _common_and_left(background: Float32Array, image: Float32Array) -> Float64Array:
    """Return common change and residual of the light of each cell, (2, rows, columns, 3).

    The common change is a gain and an offset of each channel, by the cells that follow it.
    """
    changes = np.full((2, *background.shape), np.nan)
    for k in range(3):
        reference = background[..., k].astype(np.float64)
        measured = image[..., k].astype(np.float64)
        valid_mask = np.isfinite(reference) & np.isfinite(measured)
        inlier_mask = valid_mask
        for _ in range(ROUNDS if valid_mask.any() else 0):
            line = np.polyfit(reference[inlier_mask], measured[inlier_mask], 1)
            expected = np.polyval(line, reference)
            deviation = np.abs(measured - expected)
            inlier_mask = valid_mask & (deviation <= 3.0 * robust_sd(deviation[inlier_mask]))
            changes[..., k] = expected / reference - 1.0, (measured - expected) / reference
    return changes
