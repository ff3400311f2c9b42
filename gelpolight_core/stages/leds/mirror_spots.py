"""Find the three mirror spots: one per LED, each in its own channel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.image.scaled_difference import ROUNDING
from gelpolight_core.session.decisions import PLACED_SD_PX
from gelpolight_core.session.session_images import require_colour

RIVAL_FLUX = 0.5
MERGED_SHARE = 0.6
# Signal-to-noise ratio of a spot.
LEAST_SPOT = 8.0
COLOUR_TOP = 0.97
COLOUR_SHARES = (0.5, 0.15)


@dataclass(frozen=True, slots=True)
class MirrorSpot:
    """One bright spot of the mirror image.

    Attributes
    ----------
    centre_px : (2,)
        Intensity-weighted centroid (u, v).
    centre_sd_px : float
        Standard deviation of the centroid from pixel noise and quantisation.
    area_px : int
        Pixels above half of the spot's peak.
    peak : tuple of 3 floats
        Brightest value in each channel, 0..1.
    flux : tuple of 3 floats
        Light above the local background, summed over the spot, per channel.
    colour : tuple of 3 floats
        Light of each channel relative to the brightest channel, from unsaturated pixels; NaN if
        there are too few.
    elongation : float
        Ratio of long to short axis of the spot.
    touches_border : bool
        Whether the spot is cut by the image border.
    """

    centre_px: tuple[float, float]
    centre_sd_px: float
    area_px: int
    peak: tuple[float, float, float]
    flux: tuple[float, float, float]
    colour: tuple[float, float, float]
    elongation: float
    touches_border: bool


@dataclass(frozen=True, slots=True)
class MirrorSpots:
    """The mirror spots of the red, green and blue LED, with the rejected spots.

    Attributes
    ----------
    spots : tuple of 3 MirrorSpot
        Spot k belongs to LED k.
    rejected : tuple of (MirrorSpot, str)
        Glints and multiple reflections, each with the reason.
    quality : QualityTable
        Figures, limits and advice.
    """

    spots: tuple[MirrorSpot, MirrorSpot, MirrorSpot]
    rejected: tuple[tuple[MirrorSpot, str], ...]
    quality: QualityTable

    @property
    def centres_px(self) -> Float64Array:
        """(3, 2) centroids (u, v)."""
        return np.array([s.centre_px for s in self.spots])


def find_mirror_spots(
    image: LinearImage, *, placed: Mapping[int, tuple[float, float]] | None = None
) -> MirrorSpots:
    """Find the reflections of the three LEDs in the mirror image.

    Parameters
    ----------
    image : LinearImage
        The mirror on the top surface, all three LEDs on, room dark.
    placed : mapping of int to (u, v), optional
        Spots set by the user, by LED, in pixels. A position on the centroid of a detected spot
        selects that spot; otherwise the position itself is used, with the uncertainty of a click.

    Raises
    ------
    InputError
        If the image is grey, black or flooded with light, or if a spot is missing, merged with
        another, cut by the border, or has a rival of similar brightness in its own colour.
    """
    where = f"mirror/{image.name}"
    require_colour(image, where=where)
    rgb = image.rgb.astype(np.float64)
    brightest = rgb.max(axis=2)
    _refuse_hopeless(brightest, where)
    noise = _noise(rgb)
    candidates = _find_candidates(rgb, noise)
    placed = placed or {}
    if not placed:
        _refuse_merged(candidates, where)
    by_led = []
    rejected: list[tuple[MirrorSpot, str]] = []
    for channel in range(3):
        if channel in placed:
            by_led.append(_placed_spot(candidates, placed[channel], rgb))
            continue
        spot, others = _choose(candidates, channel, where)
        by_led.append(spot)
        rejected += others
    spots = (by_led[0], by_led[1], by_led[2])
    rejected = [(spot, reason) for spot, reason in rejected if spot not in spots]
    light = _weakest_light(spots, rgb) / noise
    return MirrorSpots(spots, tuple(rejected), QualityTable(_judge(spots, rejected, light)))


def spot_near(image: LinearImage, position_px: tuple[float, float]) -> tuple[float, float] | None:
    """Return the centroid of the spot within 8 px, of any colour, or None if there is none.

    Parameters
    ----------
    image : LinearImage
        The mirror.
    position_px : (u, v)
        Position set by the user.
    """
    rgb = image.rgb.astype(np.float64)
    centres = [spot.centre_px for spot in _find_candidates(rgb, _noise(rgb))]
    nearest = min(centres, key=lambda centre: math.dist(centre, position_px), default=None)
    return nearest if nearest is not None and math.dist(nearest, position_px) <= 8.0 else None


def _refuse_hopeless(brightest: Float64Array, where: str) -> None:
    if brightest.max() < 0.05:
        text = f"The image is black (brightest value {brightest.max():.0%})"
        raise InputError(text, where, Remedy.LIGHT_ON)
    share = float((brightest > 0.25 * brightest.max()).mean())
    # Three spots are a far smaller share of the image.
    if share > 0.02:
        text = f"{share:.0%} of the image is bright, but only three small spots are expected"
        raise InputError(text, where, Remedy.CLEAN_MIRROR)


def _noise(rgb: Float64Array) -> float:
    """Return the noise of the dark part, but at least the rounding noise of 8 bits."""
    return max(robust_sd(rgb - np.median(rgb, axis=(0, 1))), ROUNDING / math.sqrt(2.0))


def _find_candidates(rgb: Float64Array, noise: float) -> list[MirrorSpot]:
    background = np.median(rgb, axis=(0, 1))
    excess = rgb - background
    brightest = excess.max(axis=2)
    threshold = max(LEAST_SPOT * noise, 0.04 * float(brightest.max()))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        (brightest > threshold).astype(np.uint8), connectivity=8
    )
    return [_describe(excess, rgb, labels, n, stats[n], noise) for n in range(1, len(stats))]


def _describe(
    excess: Float64Array,
    rgb: Float64Array,
    labels: NDArray[np.int32],
    label: int,
    stat: Float64Array,
    noise: float,
) -> MirrorSpot:
    left, top, width, height = (int(stat[i]) for i in range(4))
    rows, columns = labels.shape
    # A margin of two pixels includes the blurred edge, whose light belongs to the centroid.
    box = np.s_[max(top - 2, 0) : top + height + 2, max(left - 2, 0) : left + width + 2]
    dilated = cv2.dilate((labels[box] == label).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    spot_mask = dilated & ((labels[box] == label) | (labels[box] == 0))
    light = np.where(spot_mask[..., None], np.maximum(excess[box], 0.0), 0.0)
    light[light < 2.0 * noise] = 0.0
    v, u = np.mgrid[
        box[0].start : box[0].start + light.shape[0], box[1].start : box[1].start + light.shape[1]
    ]
    total = light.sum(axis=2)
    flux = float(total.sum())
    cu, cv = float((total * u).sum() / flux), float((total * v).sum() / flux)
    moments = (
        np.array(
            [
                [(total * (u - cu) ** 2).sum(), (total * (u - cu) * (v - cv)).sum()],
                [(total * (u - cu) * (v - cv)).sum(), (total * (v - cv) ** 2).sum()],
            ]
        )
        / flux
    )
    axes = np.sqrt(np.maximum(np.linalg.eigvalsh(moments), 1.0 / 12.0))
    variance = (total > 0.0) * ((u - cu) ** 2 + (v - cv) ** 2) / 2.0
    sd = float(noise * np.sqrt(3.0 * variance.sum()) / flux)
    inner = spot_mask & (labels[box] == label)
    return MirrorSpot(
        (cu, cv),
        sd,
        int((total > 0.5 * total.max()).sum()),
        _triple(np.where(inner[..., None], rgb[box], 0.0).max(axis=(0, 1))),
        _triple(light.sum(axis=(0, 1))),
        _triple(_colour(excess[box], rgb[box].max(axis=2), total)),
        float(axes[1] / axes[0]),
        left == 0 or top == 0 or left + width >= columns or top + height >= rows,
    )


def _colour(excess: Float64Array, brightest: Float64Array, total: Float64Array) -> Float64Array:
    """Return the channel sums over unsaturated pixels, brightest 1, with negative noise.

    A saturated spot still has unsaturated flanks, because a lens always blurs it over some pixels.
    """
    for share in COLOUR_SHARES:
        clear = (brightest < COLOUR_TOP) & (total > share * total.max())
        if clear.sum() >= 5:
            core = excess[clear].sum(axis=0)
            return np.asarray(core / core.max())
    return np.full(3, np.nan)


def _triple(values: Float64Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _dominant(spot: MirrorSpot) -> int:
    return int(np.argmax(spot.flux))


def _placed_spot(
    candidates: list[MirrorSpot], position: tuple[float, float], rgb: Float64Array
) -> MirrorSpot:
    """Return the spot set by the user, without a colour if none was detected there."""
    for spot in candidates:
        # A position read from a detected spot identifies that spot.
        if math.dist(spot.centre_px, position) < 0.05:
            return spot
    rows, columns = rgb.shape[:2]
    v = min(max(round(position[1]), 0), rows - 1)
    u = min(max(round(position[0]), 0), columns - 1)
    nothing = (math.nan, math.nan, math.nan)
    return MirrorSpot(
        position, PLACED_SD_PX, 1, _triple(rgb[v, u]), (0.0, 0.0, 0.0), nothing, 1.0, False
    )


def _refuse_merged(candidates: list[MirrorSpot], where: str) -> None:
    """Two LEDs in one spot appear as two strong channels while one channel has no own spot."""
    missing = {0, 1, 2} - {_dominant(s) for s in candidates}
    for spot in candidates:
        flux = np.array(spot.flux) / max(spot.flux)
        merged = [k for k in missing if flux[k] > MERGED_SHARE]
        if merged and max(spot.flux) > 0.1 * max(max(s.flux) for s in candidates):
            name, other = CHANNEL_KEYS[_dominant(spot)], CHANNEL_KEYS[merged[0]]
            u, v = spot.centre_px
            text = f"The {name} and {other} spots are merged near ({u:.0f}, {v:.0f})"
            raise InputError(text, where, Remedy.SHORTER_EXPOSURE)


def _choose(
    candidates: list[MirrorSpot], channel: int, where: str
) -> tuple[MirrorSpot, list[tuple[MirrorSpot, str]]]:
    of_colour = sorted(
        (s for s in candidates if _dominant(s) == channel), key=lambda s: -s.flux[channel]
    )
    name = CHANNEL_KEYS[channel]
    if not of_colour:
        raise InputError(f"The {name} LED has no spot", where, Remedy.MIRROR_VIEW)
    main, others = of_colour[0], of_colour[1:]
    rivals = sum(s.flux[channel] > RIVAL_FLUX * main.flux[channel] for s in others)
    if rivals:
        text = f"There are {1 + rivals} {name} spots of similar brightness"
        raise InputError(text, where, Remedy.CLEAN_MIRROR)
    if main.touches_border:
        text = f"The {name} spot is cut by the image border"
        raise InputError(text, where, Remedy.MIRROR_VIEW)
    reason = f"Fainter than the main spot of the {name} LED: a glint or second reflection"
    return main, [(spot, reason) for spot in others]


def _weakest_light(spots: tuple[MirrorSpot, MirrorSpot, MirrorSpot], rgb: Float64Array) -> float:
    """Return the smallest signal of an LED's own colour at its spot, above the background.

    If another LED's colour is far brighter there, the signal does not belong to this LED.
    """
    background = np.median(rgb, axis=(0, 1))
    light = []
    for k, spot in enumerate(spots):
        column, row = round(spot.centre_px[0]), round(spot.centre_px[1])
        window = np.s_[max(row - 1, 0) : max(row, 0) + 2, max(column - 1, 0) : max(column, 0) + 2]
        excess = (rgb[window] - background).reshape(-1, 3).max(axis=0, initial=0.0)
        light.append(float(excess[k]) if excess[k] > 0.5 * excess.max() else 0.0)
    return min(light)


def _judge(
    spots: tuple[MirrorSpot, MirrorSpot, MirrorSpot],
    rejected: list[tuple[MirrorSpot, str]],
    light: float,
) -> tuple[Finding, ...]:
    saturated = max(s.peak[k] for k, s in enumerate(spots))
    return (
        judge(
            "spot_light",
            "Weakest spot, signal-to-noise ratio",
            light,
            warn=2.0 * LEAST_SPOT,
            fail=LEAST_SPOT,
            higher_is_better=True,
            remedy=(
                "An LED's spot is dark or has another LED's colour: drag it onto the LED's "
                "reflection, or use a longer exposure"
            ),
        ),
        judge(
            "centroid_sd_px",
            "Spot centroid, standard deviation",
            max(s.centre_sd_px for s in spots),
            "px",
            warn=0.1,
            fail=0.5,
            remedy="Average more frames, or use a longer exposure",
        ),
        judge(
            "spot_peak",
            "Brightest spot",
            saturated,
            warn=SATURATED,
            remedy="The spots are saturated: use a shorter exposure",
        ),
        judge(
            "spot_elongation",
            "Longest spot, axis ratio",
            max(s.elongation for s in spots),
            warn=1.5,
            fail=3.0,
            remedy=(
                "A spot is elongated: hold the mirror still and flat, or use a shorter exposure"
            ),
        ),
        judge(
            "spots_rejected",
            "Other spots rejected",
            float(len(rejected)),
            warn=3.0,
            remedy="There are many glints: darken the room and clean the mirror",
        ),
    )
