"""Light intensity on the membrane from the whiteboard image (Eq. 5)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, Verdict, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.resampling import MembraneGrid, ResamplingTable
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.light.directions import flat_cosines, light_directions
from gelpolight_core.session.session_images import require_colour

from .air_gap import air_gap_share

SMOOTHING_MM = 0.5
DUST_SIGMAS = 5.0
LIGHT_BANDS = 16
LEAST_DUST = 0.01
LEAST_LIGHT = 0.02
# If the logarithm spreads more than this, a channel is not lit by its own LED; lobes stay well
# below.
UNEVEN = 0.15
DUST_WARN_PERCENT, DUST_FAIL_PERCENT = 3.0, 20.0
"""Of the board: dust, which is filled in, or air below it, which makes the light wrong."""


@dataclass(frozen=True, slots=True)
class LightIntensityResult:
    """The light intensity of each LED at every membrane node.

    Attributes
    ----------
    radiance : (rows, columns, 3) float32
        ``|L_k|`` of Eq. (5), in pixel values 0..1; 0 without light.
    usable : (rows, columns) bool
        Nodes where all three channels have light.
    saturated, dust : (rows, columns) bool
        Pixels left out and filled from their surroundings, for an overlay.
    quality : QualityTable
        Figures, limits and advice.
    """

    radiance: Float32Array
    usable: BoolArray
    saturated: BoolArray
    dust: BoolArray
    quality: QualityTable


def calibrate_radiance(
    whiteboard: LinearImage,
    table: ResamplingTable,
    led_positions_mm: Float64Array,
    *,
    elastomer_index: float,
) -> LightIntensityResult:
    """Measure the light intensity from a white diffuse board pressed on the top surface.

    The board is Lambertian and faces down, so ``|L_k| = I_k / cos(theta_k)`` (Eq. 5). The ratio of
    this to the inverse-square law of a Lambertian LED is nearly constant. This ratio is smoothed
    (about a polynomial trend), so that saturated and dusty areas are filled with the value from the
    law.

    Parameters
    ----------
    whiteboard : LinearImage
        Raw image, elastomer mounted, no membrane.
    table : ResamplingTable
        Raw pixel for every membrane node.
    led_positions_mm : (3, 3)
        LED positions, sensor frame.
    elastomer_index : float
        Refractive index of the elastomer.

    Raises
    ------
    InputError
        If the image is grey, too dark in a channel, saturated over most of the field, or a channel
        is lit from the position of another LED; if the board does not touch the elastomer.
    """
    where = f"whiteboard/{whiteboard.name}"
    require_colour(whiteboard, where=where)
    image = table.apply(whiteboard.rgb)
    cosines = flat_cosines(table, led_positions_mm)
    # A Lambertian LED facing the membrane: the lobe is the cosine of the same angle, as the faces
    # are parallel. The distance is the height over the cosine.
    law = cosines * cosines * cosines / led_positions_mm[:, 2] ** 2
    saturated = (image >= SATURATED).any(axis=2) & table.valid
    _refuse_hopeless(image, saturated, table.valid, where)
    sigma_px = SMOOTHING_MM / table.grid.pitch_mm
    # A median keeps edges and removes noise: noise alone must not look like a lit board.
    filtered = np.asarray(cv2.medianBlur(np.ascontiguousarray(image), 5), np.float32)
    board = _board_area(filtered, table.valid)
    _refuse_other_lights(image[board], (cosines * law)[board], where)
    contact = _judge_contact(
        air_gap_share(
            filtered,
            cosines * law,
            cosines,
            board & ~saturated,
            index=elastomer_index,
            pitch_mm=table.grid.pitch_mm,
        ),
        elastomer_index,
        where,
    )
    radiance = np.zeros(image.shape, dtype=np.float32)
    dust = np.zeros(saturated.shape, dtype=bool)
    for k in range(3):
        ratio = (image[..., k] / (cosines[..., k] * law[..., k])).astype(np.float32)
        valid_board = board & (image[..., k] < SATURATED) & (image[..., k] > 0.0)
        trend = _trend(ratio, valid_board, table.grid)
        smooth, outliers = _smooth_robustly(ratio / trend, valid_board, law[..., k], sigma_px)
        smooth *= trend
        dust |= outliers & (filtered[..., k] > LEAST_LIGHT)
        radiance[..., k] = np.where(board, smooth * law[..., k], 0.0)
    usable = board & (radiance * cosines > LEAST_LIGHT).all(axis=2)
    figures = _judge(radiance, table.valid, usable, saturated, dust)
    quality = QualityTable((*contact, *figures))
    return LightIntensityResult(radiance, usable, saturated, dust, quality)


def radiance_by_positions(
    background: Float32Array, table: ResamplingTable, led_positions_mm: Float64Array
) -> LightIntensityResult:
    """Return the light intensity of Lambertian LEDs, where no board shows it.

    Parameters
    ----------
    background : (rows, columns, 3) float32
        The membrane, whose median reflectance factor is 1.
    table, led_positions_mm
        As in :func:`calibrate_radiance`.
    """
    points = table.surface.points(table.grid.points_mm())
    light, distance = light_directions(led_positions_mm, points)
    law = -light[..., 2] / distance**2
    expected = law * flat_cosines(table, led_positions_mm)
    lit = table.valid & (background > LEAST_LIGHT).all(axis=2)
    level = np.median(background[lit] / expected[lit], axis=0) if lit.any() else np.zeros(3)
    radiance = np.where(table.valid[..., None], level * law, 0.0).astype(np.float32)
    dark = np.zeros_like(lit)
    quality = QualityTable(_judge(radiance, table.valid, lit, dark, dark))
    return LightIntensityResult(radiance, lit, dark, dark, quality)


def _refuse_hopeless(
    image: Float32Array, saturated: BoolArray, valid: BoolArray, where: str
) -> None:
    brightest = [float(np.percentile(image[..., k][valid], 99)) for k in range(3)]
    if min(brightest) < 2 * LEAST_LIGHT:
        name = CHANNEL_KEYS[int(np.argmin(brightest))]
        text = f"The {name} channel is dark (brightest value {min(brightest):.1%})"
        raise InputError(text, where, Remedy.LIGHT_ON)
    share = float(saturated[valid].mean())
    if share > 0.3:
        text = f"{share:.0%} of the working area is saturated"
        raise InputError(text, where, Remedy.SHORTER_EXPOSURE)


def _refuse_other_lights(light: Float32Array, expected: Float64Array, where: str) -> None:
    """Refuse LEDs if another LED explains a channel (N, 3) far better than its own.

    With its own LED, the ratio of board light to the law is uniform except for the lobe; with an
    LED at another position it slopes from one side to the other.
    """
    for k, name in enumerate(CHANNEL_KEYS):
        lit = light[:, k] > LEAST_LIGHT
        if lit.sum() < 1000:
            continue
        log_sd = np.log(light[lit, k : k + 1] / np.maximum(expected[lit], 1e-12)).std(axis=0)
        best = int(np.argmin(log_sd))
        if best != k and log_sd[k] > UNEVEN and log_sd[best] < 0.5 * log_sd[k]:
            text = (
                f"The {name} channel is lit from the position of the {CHANNEL_KEYS[best]} LED in "
                "the mirror image"
            )
            raise InputError(text, where, Remedy.MIRROR_AGAIN)


def _judge_contact(share: float, index: float, where: str) -> tuple[Finding, ...]:
    """Judge the share of the board with air below it; there is no figure if it is small.

    Raises
    ------
    InputError
        If it is large.
    """
    percent, dark_deg = 100.0 * share, float(np.degrees(np.arcsin(1.0 / max(index, 1.0))))
    if percent > DUST_FAIL_PERCENT:
        text = (
            f"The board does not touch the gel (dark beyond {dark_deg:.0f} degrees from each LED)"
        )
        raise InputError(text, where, Remedy.PRESS_BOARD)
    figure = judge(
        "whiteboard_gap_percent",
        f"Board that does not touch the gel, dark beyond {dark_deg:.0f} degrees from each LED",
        percent,
        "%",
        warn=DUST_WARN_PERCENT,
        fail=DUST_FAIL_PERCENT,
        remedy=Remedy.PRESS_BOARD,
    )
    return () if figure.verdict is Verdict.PASS else (figure,)


def _board_area(image: Float32Array, valid: BoolArray) -> BoolArray:
    """Return the area of the whiteboard.

    It can be smaller than the working circle. Dark specks on the board belong to it; a few mixed
    pixels along its edge do not.
    """
    lit = (valid & (image.max(axis=2) > LEAST_LIGHT)).astype(np.uint8)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (15, 15))
    closed = cv2.morphologyEx(lit, cv2.MORPH_CLOSE, disc)
    core = cv2.erode(closed, np.ones((7, 7), np.uint8), borderType=cv2.BORDER_REPLICATE)
    return (core > 0) & valid


def _trend(ratio: Float32Array, good: BoolArray, grid: MembraneGrid) -> Float32Array:
    """Return a polynomial of fourth degree through the good pixels, robust to specks.

    Near the border a blur has data on one side only; relative to the trend, that side is level.
    """
    scale = max(float(np.abs(grid.x_mm).max()), float(np.abs(grid.y_mm).max()))
    x, y = np.vander(grid.x_mm / scale, 5), np.vander(grid.y_mm / scale, 5)
    rows, columns = np.nonzero(good)
    # At most about 20,000 points.
    stride = max(rows.size // 20_000, 1)
    rows, columns = rows[::stride], columns[::stride]
    value = ratio[rows, columns].astype(np.float64)
    # Powers run from 4 to 0, so the sum of the powers of x and y is at most 4 on and below the
    # diagonal from (4, 0) to (0, 4).
    of_x, of_y = np.nonzero(np.add.outer(np.arange(5), np.arange(5)) >= 4)
    basis = x[columns][:, of_x] * y[rows][:, of_y]
    keep = np.ones(value.size, dtype=bool)
    for _ in range(3):
        weights, *_ = np.linalg.lstsq(basis[keep], value[keep], rcond=None)
        error = np.abs(basis @ weights - value)
        keep = error <= 3.0 * robust_sd(error[keep]) + 1e-9
    # Without data the polynomial may run away; it never leaves the range of the data.
    low, high = value[keep].min(), value[keep].max()
    product = np.zeros((5, 5))
    product[of_y, of_x] = weights
    return np.clip(y @ product @ x.T, low, high).astype(np.float32)


def _smooth_robustly(
    ratio: Float32Array, good: BoolArray, law: Float64Array, sigma_px: float
) -> tuple[Float32Array, BoolArray]:
    """Return the ratio smoothed over good pixels, and the pixels rejected as dust.

    Noise increases where the law predicts little light, so the weights follow the law.
    """
    weight = np.where(good, law / law[good].max() if good.any() else 0.0, 0.0).astype(np.float32)
    smooth = _weighted_blur(ratio, weight, sigma_px)
    deviation = np.where(good, ratio / smooth - 1.0, 0.0).astype(np.float32)
    # A speck changes neighbouring pixels together, noise does not: the mean of 3 x 3 pixels is
    # judged.
    deviation = _mean_of_good(deviation, good)
    noise = _noise_by_light(deviation, good, weight)
    outliers = good & (np.abs(deviation) > np.maximum(DUST_SIGMAS * noise, LEAST_DUST))
    # The edge of a speck is blurred, so the neighbours of an outlier are rejected, too.
    outliers = cv2.dilate(outliers.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    weight[outliers] = 0.0
    return _weighted_blur(ratio, weight, sigma_px), outliers & good


def _mean_of_good(values: Float32Array, good: BoolArray) -> Float32Array:
    """Return the mean of the good pixels within 3 x 3, 0 for the other pixels."""
    count = np.asarray(cv2.blur(good.astype(np.float32), (3, 3)))
    total = np.asarray(cv2.blur(np.where(good, values, np.float32(0.0)), (3, 3)))
    return np.asarray(np.where(good, total / np.maximum(count, 1e-3), 0.0), np.float32)


def _noise_by_light(deviation: Float32Array, good: BoolArray, light: Float32Array) -> Float32Array:
    """Return the noise of the relative deviation as a function of the amount of light.

    Read noise and shot noise depend on the light differently. No law is assumed: the spread is
    measured in bands of equal light. Dust is too rare in a band to change its median.
    """
    if not good.any():
        return np.zeros_like(deviation)
    edges = np.quantile(light[good], np.linspace(0.0, 1.0, LIGHT_BANDS + 1))
    band = np.clip(np.searchsorted(edges, light[good], side="right") - 1, 0, LIGHT_BANDS - 1)
    size = np.abs(deviation[good])
    bands = [
        (float(np.median(light[good][band == k])), robust_sd(size[band == k]))
        for k in range(LIGHT_BANDS)
        if (band == k).any()
    ]
    medians, sds = np.array(bands).T
    return np.asarray(np.interp(light, medians, sds), np.float32)


def _weighted_blur(values: Float32Array, weight: Float32Array, sigma_px: float) -> Float32Array:
    """Normalised Gaussian blur, with the next wider average for pixels without weight."""
    weight_sum = float((weight).sum())
    mean = float((values * weight).sum()) / max(weight_sum, 1e-12)
    result = np.full_like(values, mean)
    floor = 1e-3 * float(weight.max())
    for widen in (9.0, 3.0, 1.0):
        blurred, total = _blur_reduced(values * weight, weight, sigma_px * widen)
        reached = total > floor
        result[reached] = blurred[reached] / total[reached]
    return result


def _blur_reduced(
    values: Float32Array, weight: Float32Array, sigma_px: float
) -> tuple[Float32Array, Float32Array]:
    """Blur two maps on a reduced grid on which the Gaussian still spans several nodes."""
    factor = max(int(sigma_px / 4.0), 1)
    rows, columns = values.shape
    size = (max(columns // factor, 1), max(rows // factor, 1))
    blurred = []
    for plane in (values, weight):
        small = cv2.resize(plane, size, interpolation=cv2.INTER_AREA)
        small = cv2.GaussianBlur(small, (0, 0), sigma_px / factor, borderType=cv2.BORDER_REFLECT)
        blurred.append(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR))
    return np.asarray(blurred[0], np.float32), np.asarray(blurred[1], np.float32)


def _judge(
    radiance: Float32Array,
    valid: BoolArray,
    usable: BoolArray,
    saturated: BoolArray,
    dust: BoolArray,
) -> tuple[Finding, ...]:
    inside = radiance[usable] if usable.any() else radiance[valid]
    evenness = float(
        (inside.max(axis=0) / np.maximum(np.percentile(inside, 1, axis=0), 1e-6)).max()
    )
    return (
        judge(
            "whiteboard_saturated_percent",
            "Saturated share of the working area",
            100.0 * float(saturated[valid].mean()),
            "%",
            warn=0.1,
            fail=10.0,
            remedy="Use a shorter exposure so that nothing is saturated",
        ),
        judge(
            "whiteboard_dust_percent",
            "Dust and scratches, share of the working area",
            100.0 * float(dust[valid].mean()),
            "%",
            warn=DUST_WARN_PERCENT,
            fail=DUST_FAIL_PERCENT,
            remedy="Clean the whiteboard and the elastomer and repeat",
        ),
        judge(
            "whiteboard_unlit_percent",
            "Unlit share of the working area",
            100.0 * float(1.0 - usable[valid].mean()),
            "%",
            warn=10.0,
            fail=40.0,
            remedy="Use a longer exposure, or move the LEDs outward or lower",
        ),
        judge(
            "light_range",
            "Light, ratio of brightest to darkest area of a channel",
            evenness,
            warn=40.0,
            remedy="Lower or move the LEDs for more even light",
        ),
    )
