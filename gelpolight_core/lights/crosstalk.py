"""How much of each LED's light the camera's other channels see.

From pictures with one LED lit each, where a session has them; else from the mirror spots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.lights.mirror import CHANNEL_NAMES, MirrorSpots
from gelpolight_core.quality import QualityTable, judge
from gelpolight_core.session.picture import Picture
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# Values that hold light worth a ratio: above a tenth of the brightest, below the end of the scale.
WELL_EXPOSED = 0.1
SATURATED = 0.97
LEAST_LIGHT = 0.1
LEAST_BLOCKS = 50
BLOCKS = 4800
# A ratio and a dark offset can be told apart where the light varies by this factor; where it is
# more even, the offset is taken as none.
LEAST_RANGE = 1.5
TUKEY = 4.7
ROUNDS = 8
# A colour filter that passes more of its neighbour is no filter: two LEDs were lit, or a white one.
LARGEST_LEAK = 0.6


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

    matrix: Array
    source: str
    quality: QualityTable


def find_crosstalk(spots: MirrorSpots, single_led: Sequence[Picture] = ()) -> CrosstalkResult:
    """Find the crosstalk, from single-LED pictures where there are any, else from mirror spots.

    Parameters
    ----------
    spots : MirrorSpots
        Of the three LEDs.
    single_led : sequence of 3 Picture, optional
        The whiteboard or bare membrane with the red, the green, the blue LED lit alone.

    Raises
    ------
    InputError
        If a single-LED picture is dark, saturated, or lit by another LED than its name says.
    """
    mirror = crosstalk_from_spots(spots)
    if not single_led:
        figure = judge(
            "crosstalk_percent",
            tr("Crosstalk, largest, from the mirror spots"),
            _largest(mirror),
            "%",
        )
        return CrosstalkResult(mirror, "mirror", QualityTable((figure,)))
    columns = [_column(picture, k) for k, picture in enumerate(single_led)]
    matrix = np.stack([column for column, _ in columns], axis=1)
    figures = (
        judge(
            "crosstalk_percent",
            tr("Crosstalk, largest, from the single-LED pictures"),
            _largest(matrix),
            "%",
        ),
        judge(
            "crosstalk_scatter_percent",
            tr("Crosstalk over the picture, scatter"),
            100.0 * max(scatter for _, scatter in columns),
            "%",
            warn=2.0,
            advice=tr("Darken the room and light one LED only for each picture"),
        ),
        judge(
            "crosstalk_difference_percent",
            tr("Crosstalk from the mirror spots less this (which is used)"),
            _largest(np.eye(3) + mirror - matrix),
            "%",
            warn=2.0,
            advice=tr(
                "Check that each picture shows one LED alone, and the mirror spots' exposure"
            ),
        ),
    )
    return CrosstalkResult(matrix, "single_led", QualityTable(figures))


def _largest(matrix: Array) -> float:
    return 100.0 * float(np.abs(matrix - np.eye(3)).max())


def crosstalk_from_spots(spots: MirrorSpots) -> Array:
    """Return the matrix M (3, 3) of ``I_raw = M I_true``; column k is LED k, diagonal 1.

    A spot without unsaturated pixels says nothing of the ratio; its column is left without
    crosstalk.
    """
    matrix = np.eye(3)
    for k, spot in enumerate(spots.spots):
        if np.isfinite(spot.colour).all():
            matrix[:, k] = np.maximum(np.asarray(spot.colour) / spot.colour[k], 0.0)
    return matrix


def _column(picture: Picture, led: int) -> tuple[Array, float]:
    """Return what each channel sees of one LED, and how much that scatters over the picture."""
    blocks = _block_means(picture.rgb.astype(np.float64))
    own = blocks[:, led]
    _refuse_unfit(blocks, led, f"single_led/{picture.name}")
    brightest = float(np.quantile(own, 0.99))
    good = (own > WELL_EXPOSED * brightest) & (blocks.max(axis=1) < SATURATED)
    column, scatter = np.eye(3)[led], 0.0
    for channel in set(range(3)) - {led}:
        leak, spread = _robust_ratio(own[good], blocks[good, channel])
        column[channel] = max(leak, 0.0)
        scatter = max(scatter, spread)
    return column, scatter


def _block_means(rgb: Array) -> Array:
    """Return (blocks, 3) means; a block with a saturated pixel is given the value 1."""
    rows, columns, _ = rgb.shape
    side = max(2, round(np.sqrt(rows * columns / BLOCKS)))
    cut = rgb[: rows // side * side, : columns // side * side]
    cut = cut.reshape(rows // side, side, columns // side, side, 3)
    full = (cut >= SATURATED).any(axis=(1, 3))
    return np.asarray(np.where(full, 1.0, cut.mean(axis=(1, 3))).reshape(-1, 3))


def _robust_ratio(own: Array, other: Array) -> tuple[float, float]:
    """Return d(other)/d(own) by a line with Tukey's biweight, and the scatter about it over own.

    The line's offset is what the channels show in the dark; it is no crosstalk.
    """
    low, high = np.quantile(own, [0.02, 0.98])
    terms = np.stack([own, np.ones_like(own)], axis=1)
    if high < LEAST_RANGE * low:
        terms = terms[:, :1]
    weight = np.ones_like(own)
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        line, *_ = np.linalg.lstsq(terms * root[:, None], other * root, rcond=None)
        error = other - terms @ line
        scale = 1.4826 * float(np.median(np.abs(error))) + 1e-9
        weight = np.clip(1.0 - (error / (TUKEY * scale)) ** 2, 0.0, None) ** 2
    return float(line[0]), scale / float(np.median(own))


def _refuse_unfit(blocks: Array, led: int, where: str) -> None:
    name = tr(CHANNEL_NAMES[led])
    if float(np.quantile(blocks, 0.99)) < LEAST_LIGHT:
        raise InputError(
            tr("the picture is dark (brightest {v:.1%})").format(v=np.quantile(blocks, 0.99)),
            where=where,
            advice=tr("Light the {name} LED alone, or expose longer").format(name=name),
        )
    clear = blocks[(blocks < SATURATED).all(axis=1)]
    lit = clear[clear.max(axis=1, initial=0.0) > LEAST_LIGHT / 2.0]
    if len(lit) < LEAST_BLOCKS:
        raise InputError(
            tr("the picture is saturated nearly everywhere that is lit"),
            where=where,
            advice=tr("Shorten the exposure"),
        )
    shares = np.median(lit / np.maximum(lit[:, led : led + 1], 1e-6), axis=0)
    strongest = int(np.argmax(shares))
    rival = int(np.argmax(np.where(np.arange(3) == led, 0.0, shares)))
    if strongest != led or shares[rival] > LARGEST_LEAK:
        raise InputError(
            tr("the {other} channel has {x:.0%} of the {name} channel's light").format(
                other=tr(CHANNEL_NAMES[rival]), x=min(shares[rival], 1e3), name=name
            ),
            where=where,
            advice=tr("Light the {name} LED alone for this picture").format(name=name),
        )


def unmix(rgb: NDArray[np.float32], crosstalk: Array) -> NDArray[np.float32]:
    """Remove crosstalk from linear light (..., 3).

    Parameters
    ----------
    rgb : (..., 3) float32
        Linear light as the camera's channels saw it.
    crosstalk : (3, 3)
        M of ``I_raw = M I_true``.
    """
    return np.asarray(rgb @ np.linalg.inv(crosstalk).T, dtype=np.float32)
