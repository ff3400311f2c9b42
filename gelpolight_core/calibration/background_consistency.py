"""The background against the untouched part of the ball images.

What a ball does not touch must look as in the background, except for light that is common to the
whole field. What differs in the same way in every image is wrong in the background.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import SD_OF_MEDIAN, robust_sd
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.image.image_file import names_of
from gelpolight_core.reconstruction.near_light.sensor_maps import block_average
from gelpolight_core.stages.balls.ball_press import LEAST_VALUE, BallPress
from gelpolight_core.stages.balls.indentation_checks import DETECTION

from .ball_image import BallImageResult, what_changed
from .ball_pixels import DRAPE_WIDTH_MM
from .height_limits import FAIL_PERCENT, WARN_PERCENT

HEIGHT_BY_LIGHT = 4.5
"""Relative change of a height by that of all light. The slope beside a step of 1 % of that press
changes the light there by 1 %."""
CELL_MM, ROUNDS = 0.5, 5
HALF_STEP = 0.5 / 255.0
"""Light of 8 bit images that cannot be distinguished from their rounding: the limits of a single
press, and of what a correction leaves, are wider by it."""


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


def suspect_share(pressed: BoolArray, table: ResamplingTable, camera: CameraModel) -> Float32Array:
    """Return the share of each cell (rows, columns) that looks touched in the background.

    Parameters
    ----------
    pressed : (rows, columns) bool
        The areas in the camera's image, at any size.
    table : ResamplingTable
        The grid and its rays.
    camera : CameraModel
        The size of its images.
    """
    size = camera.width, camera.height
    image = cv2.resize(pressed.astype(np.float32), size, interpolation=cv2.INTER_NEAREST)
    on_grid = table.apply(np.asarray(image, np.float32)) * table.valid
    return block_average(on_grid, cell_nodes(table))


def judge_background(
    background: Float32Array,
    suspect: Float32Array,
    balls: Sequence[BallImageResult],
    table: ResamplingTable,
) -> tuple[Finding, ...]:
    """Judge the background by what all images of presses show.

    Parameters
    ----------
    background : (rows, columns, 3) float32
        Cells.
    suspect : (rows, columns) float32
        Result of :func:`suspect_share`.
    balls : sequence of BallImageResult
        Images that can be used.
    table : ResamplingTable
        The grid.
    """
    images = [ball.cells for ball in balls if ball.cells is not None]
    fitted = np.array([_common_and_left(background, image) for image in images])
    times = np.isfinite(fitted).all(axis=(1, 4)).sum(axis=0) if images else 0 * suspect
    findings: tuple[Finding, ...] = ()
    # Light that is known in two images: one alone cannot tell which of the two is wrong.
    often = times > 1
    if often.any():
        common, residual = fitted[:, 0, often], fitted[:, 1, often]
        lights = _judge_light(common, background[often], balls)
        findings = (lights, _judge_places(residual, background, often, table))
    seen, agrees = times > 0, np.zeros(suspect.shape, np.bool_)
    if seen.any():
        residual = fitted[:, 1, seen]
        usual = np.abs(np.nanmedian(residual, axis=0))
        clear = usual - DETECTION * _residual_noise(residual, background[seen])
        agrees[seen] = (100.0 * clear < FAIL_PERCENT).all(axis=1)
    return (*findings, *_judge_spots(suspect, seen, agrees, table))


def _judge_light(
    common: Float64Array, level: Float32Array, balls: Sequence[BallImageResult]
) -> Finding:
    """Judge the change of light that remains, and what was corrected.

    Parameters
    ----------
    common : (presses, cells, 3)
        Change that remains in each press, as a share of the background's light.
    level : (cells, 3) float32
        The background's light.
    balls : sequence of BallImageResult
        The presses.
    """
    text = "Light of the ball presses against the background"
    warn, fail = WARN_PERCENT / HEIGHT_BY_LIGHT, FAIL_PERCENT / HEIGHT_BY_LIGHT
    most = max(balls, key=lambda ball: ball.light.largest * (ball.press is not None))
    corrected = 100.0 * most.light.largest * (most.press is not None)
    rounding = HALF_STEP / np.median(level, axis=0)
    of_all = np.sqrt(np.mean(np.nanmedian(common, axis=0) ** 2, axis=0))
    count = np.maximum(np.isfinite(common).sum(axis=1), 1)
    of_each = (np.sqrt(np.nansum(common**2, axis=1) / count) - rounding).max(axis=1)
    # A capture without a ball is left out anyway.
    used = np.array([ball.press is not None for ball in balls])
    odd_mask = used & (100.0 * of_each > fail)
    remaining = 100.0 * float((of_all - rounding if corrected else of_all).max())
    if odd_mask.any():
        remaining = 100.0 * float(of_each[odd_mask].max())
    if remaining <= fail and corrected > 0.0:
        return judge(
            "background_light_percent",
            f"{text}, corrected",
            max(corrected, remaining),
            "%",
            warn=warn,
            remedy=(
                f"{what_changed(most.light.corrected)} changed between background and ball presses,"
                f" most in {most.file}, which is corrected: let the LEDs warm up, and lock all"
                " settings of the camera"
            ),
        )
    uncorrected = [key for ball in balls for key in ball.light.uncorrected]
    odd = [ball.file for ball, is_odd in zip(balls, odd_mask, strict=True) if is_odd]
    where = "ball presses" if len(odd) in (0, len(balls)) else names_of(odd)
    return judge(
        "background_light_percent",
        text,
        remaining,
        "%",
        warn=warn,
        fail=fail,
        remedy=(
            f"{what_changed(uncorrected)} changed between background and {where}: "
            "capture both again without a change"
        ),
    )


def _judge_places(
    residual: Float64Array, background: Float32Array, often: BoolArray, table: ResamplingTable
) -> Finding:
    """Judge the place that differs most in the image that agrees best."""
    noise = _residual_noise(residual, background[often])
    low, high = np.nanmin(residual, axis=0), np.nanmax(residual, axis=0)
    smallest = np.maximum(low, 0.0) + np.minimum(high, 0.0)
    clear = np.maximum(np.abs(smallest) - DETECTION * noise, 0.0).max(axis=1)
    place = _place(np.argwhere(often)[clear.argmax()], table)
    return judge(
        "background_place_percent",
        "Background against the untouched membrane of the ball presses, worst place",
        100.0 * float(clear.max()),
        "%",
        warn=WARN_PERCENT,
        fail=FAIL_PERCENT,
        remedy=(
            f"Something touched the membrane or lay on it at {place} in the"
            " background: clean the membrane and capture the background again"
        ),
    )


def _judge_spots(
    suspect: Float32Array, seen: BoolArray, agrees: BoolArray, table: ResamplingTable
) -> Iterator[Finding]:
    """Judge what looks touched in the background by the presses that do not touch it there.

    What they show, too, is the coating.

    Parameters
    ----------
    suspect : (rows, columns) float32
        Share of each cell that looks touched.
    seen, agrees : (rows, columns) bool
        Cells that presses show untouched, and those that usually look as in the background.
    table : ResamplingTable
        The grid.
    """
    spots, count = ndimage.label(suspect > 0.0)
    coating: list[Float32Array] = []
    touched: list[Float32Array] = []
    for number in range(1, count + 1):
        inside = spots == number
        # A spot extends beyond what is touched.
        is_coating = seen[inside].any() and not (seen & ~agrees)[inside].any()
        (coating if is_coating else touched).append(np.where(inside, suspect, 0.0))
    field = float(block_average(table.valid.astype(np.float32), cell_nodes(table)).sum())
    if coating:
        percent, place = _area_and_place(coating, field, table)
        text = f"Coating that differs from its surroundings in all images (most at {place})"
        yield judge("coating_percent", text, percent, "%")
    if touched:
        percent, place = _area_and_place(touched, field, table)
        clean = f"Remove anything that touches the membrane at {place}, wipe it clean, and capture"
        yield judge(
            "pressed",
            "Area that seems to be pressed in the background",
            percent,
            "%",
            fail=0.0,
            remedy=f"{clean} the background again",
        )


def _area_and_place(
    spots: Sequence[Float32Array], field: float, table: ResamplingTable
) -> tuple[float, str]:
    """Return the percentage of the field that some spots cover, and the place of the largest."""
    areas = [float(spot.sum()) for spot in spots]
    middle = np.array(ndimage.center_of_mass(spots[int(np.argmax(areas))]))
    return 100.0 * sum(areas) / field, _place(middle, table)


def _residual_noise(residual: Float64Array, level: Float32Array) -> Float64Array:
    """Return the noise (cells, 3) of residuals (presses, cells, 3) at a level of light."""
    usual = np.abs(np.nanmedian(residual, axis=0) * level)
    return np.asarray(SD_OF_MEDIAN * np.median(usual, axis=0) / level)


def _place(cell: NDArray[np.number], table: ResamplingTable) -> str:
    """Return x and y of the middle of a cell (row, column) for a message."""
    row, column = cell_nodes(table) * table.grid.pitch_mm * (cell + 0.5)
    return f"x {table.grid.x_mm[0] + column:.1f}, y {table.grid.y_mm[0] + row:.1f} mm"


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
