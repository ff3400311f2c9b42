"""Crosstalk: the share of each LED's light that the other camera channels see.

Measured from images with one LED each if a session has them; otherwise from the mirror spots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import TUKEY, robust_sd, tukey_weights
from gelpolight_core.image.linear_image import LinearImage

from .mirror_spots import MirrorSpots

LEAST_LIGHT = 0.1
LEAST_BLOCKS = 50
BLOCKS = 4800
# A ratio and a dark offset can be separated if the light varies by this factor; if it is more
# uniform, the offset is assumed to be zero.
LEAST_RANGE = 1.5
ROUNDS = 8


@dataclass(frozen=True, slots=True)
class CrosstalkResult:
    """The camera's channels as mixtures of the LEDs.

    Attributes
    ----------
    matrix : (3, 3)
        M of ``I_raw = M I_true``; column k is LED k, diagonal 1.
    source : str
        ``single_led`` or ``mirror``.
    quality : QualityTable
        Figures, limits and advice.
    """

    matrix: Float64Array
    source: str
    quality: QualityTable


def find_crosstalk(spots: MirrorSpots, single_led: Sequence[LinearImage] = ()) -> CrosstalkResult:
    """Find the crosstalk, from single-LED images if there are any, otherwise from mirror spots.

    Parameters
    ----------
    spots : MirrorSpots
        Spots of the three LEDs.
    single_led : sequence of 3 LinearImage, optional
        The whiteboard or bare membrane with only the red, the green or the blue LED on.

    Raises
    ------
    InputError
        If a single-LED image is dark, saturated, or lit by another LED than its name says.
    """
    mirror, measured = crosstalk_from_spots(spots)
    if not single_led:
        return CrosstalkResult(mirror, "mirror", _judge_mirror(mirror, measured))
    columns = [_column(image, k) for k, image in enumerate(single_led)]
    matrix = np.stack([column for column, _ in columns], axis=1)
    figures = [
        judge(
            "crosstalk_percent",
            "Largest crosstalk, from the single-LED images",
            _largest(matrix),
            "%",
        ),
        judge(
            "crosstalk_scatter_percent",
            "Scatter of the crosstalk over the image",
            100.0 * max(scatter for _, scatter in columns),
            "%",
            warn=2.0,
            remedy="Darken the room and switch on only one LED for each image",
        ),
    ]
    if measured.any():
        figures.append(
            judge(
                "crosstalk_difference_percent",
                "Crosstalk from the mirror spots minus this value (which is used)",
                _largest(np.eye(3) + np.where(measured, mirror - matrix, 0.0)),
                "%",
                warn=2.0,
                remedy=(
                    "Check that each image shows one LED alone, and the exposure of the mirror "
                    "image"
                ),
            )
        )
    return CrosstalkResult(matrix, "single_led", QualityTable(tuple(figures)))


def _judge_mirror(matrix: Float64Array, measured: BoolArray) -> QualityTable:
    """Judge crosstalk from the mirror spots, with a warning without a readable colour."""
    figures = [
        judge(
            "crosstalk_unmeasured",
            "LEDs with unknown crosstalk",
            float(np.count_nonzero(~measured)),
            warn=0.0,
            remedy=(
                "The mirror spots are too small or too bright to show their colour, so crosstalk "
                "is not corrected. Add single_led images, use larger images, or use a shorter "
                "exposure for the mirror"
            ),
        )
    ]
    if measured.any():
        figures.append(
            judge(
                "crosstalk_percent",
                "Largest crosstalk, from the mirror spots",
                _largest(matrix),
                "%",
            )
        )
    return QualityTable(tuple(figures))


def _largest(matrix: Float64Array) -> float:
    return 100.0 * float(np.abs(matrix - np.eye(3)).max())


def crosstalk_from_spots(spots: MirrorSpots) -> tuple[Float64Array, BoolArray]:
    """Return the matrix M of ``I_raw = M I_true`` with the mask of its measured columns.

    A spot with too few unsaturated pixels does not show its colour; its column has no crosstalk and
    counts as not measured.

    Returns
    -------
    matrix : (3, 3)
        Column k is LED k, diagonal 1.
    measured : (3,) bool
        For each LED.
    """
    matrix, measured = np.eye(3), np.zeros(3, np.bool_)
    for k, spot in enumerate(spots.spots):
        if np.isfinite(spot.colour).all() and spot.colour[k] > 0.0:
            matrix[:, k] = np.maximum(np.asarray(spot.colour) / spot.colour[k], 0.0)
            measured[k] = True
    return matrix, measured


def _column(image: LinearImage, led: int) -> tuple[Float64Array, float]:
    """Return the response of each channel to one LED with its scatter over the image."""
    blocks = _block_means(image.rgb.astype(np.float64))
    led_response = blocks[:, led]
    _refuse_unfit(blocks, led, f"single_led/{image.name}")
    brightest = float(np.quantile(led_response, 0.99))
    # Values with enough light for a ratio: above a tenth of the brightest, below saturation.
    valid = (led_response > 0.1 * brightest) & (blocks.max(axis=1) < SATURATED)
    column, scatter = np.eye(3)[led], 0.0
    for channel in set(range(3)) - {led}:
        ratio, scatter_sd = _robust_ratio(led_response[valid], blocks[valid, channel])
        column[channel] = max(ratio, 0.0)
        scatter = max(scatter, scatter_sd)
    return column, scatter


def _block_means(rgb: Float64Array) -> Float64Array:
    """Return (blocks, 3) means, with 1 for a block with a saturated pixel."""
    rows, columns, _ = rgb.shape
    side = max(2, round(np.sqrt(rows * columns / BLOCKS)))
    cut = rgb[: rows // side * side, : columns // side * side]
    cut = cut.reshape(rows // side, side, columns // side, side, 3)
    full = (cut >= SATURATED).any(axis=(1, 3))
    return np.asarray(np.where(full, 1.0, cut.mean(axis=(1, 3))).reshape(-1, 3))


def _robust_ratio(
    led_response: Float64Array, channel_response: Float64Array
) -> tuple[float, float]:
    """Return d(other)/d(own) from a line fit with Tukey's biweight, and the relative scatter.

    The offset of the line is the dark signal of the channels; it is not crosstalk.
    """
    low, high = np.quantile(led_response, [0.02, 0.98])
    terms = np.stack([led_response, np.ones_like(led_response)], axis=1)
    if high < LEAST_RANGE * low:
        terms = terms[:, :1]
    weight = np.ones_like(led_response)
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        line, *_ = np.linalg.lstsq(terms * root[:, None], channel_response * root, rcond=None)
        error = channel_response - terms @ line
        scale = robust_sd(error) + 1e-9
        weight = tukey_weights(error, TUKEY * scale)
    return float(line[0]), scale / float(np.median(led_response))


def _refuse_unfit(blocks: Float64Array, led: int, where: str) -> None:
    if float(np.quantile(blocks, 0.99)) < LEAST_LIGHT:
        text = f"The image is dark (brightest value {np.quantile(blocks, 0.99):.1%})"
        raise InputError(text, where, Remedy.LIGHT_ON)
    clear = blocks[(blocks < SATURATED).all(axis=1)]
    lit = clear[clear.max(axis=1, initial=0.0) > LEAST_LIGHT / 2.0]
    if len(lit) < LEAST_BLOCKS:
        text = "The image is saturated in nearly all lit areas"
        raise InputError(text, where, Remedy.SHORTER_EXPOSURE)
    shares = np.median(lit / np.maximum(lit[:, led : led + 1], 1e-6), axis=0)
    strongest = int(np.argmax(shares))
    rival = int(np.argmax(np.where(np.arange(3) == led, 0.0, shares)))
    # No colour filter passes more of its neighbour: two LEDs were on, or a white one.
    if strongest != led or shares[rival] > 0.6:
        name, other, share = CHANNEL_KEYS[led], CHANNEL_KEYS[rival], min(shares[rival], 1e3)
        text = f"The {other} channel has {share:.0%} of the {name} channel's light"
        raise InputError(text, where, Remedy.SINGLE_LED)


def unmix(rgb: Float32Array, crosstalk: Float64Array) -> Float32Array:
    """Remove crosstalk from linear light (..., 3).

    Parameters
    ----------
    rgb : (..., 3) float32
        Linear light as seen by the camera channels.
    crosstalk : (3, 3)
        M of ``I_raw = M I_true``.
    """
    return np.asarray(rgb @ np.linalg.inv(crosstalk).T, dtype=np.float32)
