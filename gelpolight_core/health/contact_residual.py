"""Whether the touched part of a frame agrees with the surface found.

Three channels have one degree of freedom more than a normal, so every node of the contact says
whether its light is that of the surface found. It is compared with the noise, and with the level
that the calibration's own balls have left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from statistics import NormalDist

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict

from .fault_limits import ALONE, CLEAR, GAIN, SIGMAS

EDGES = (0.1, 0.3, 0.6, 1.0, 2.0)
"""Classes of slope: an error of the model is common to all nodes of one."""
GENTLE = 1
"""The class in which single nodes are judged: on steeper ones the width of a pixel counts, too."""
LEAST_NODES = 12
"""Nodes of a class; with fewer it says nothing."""
TOGETHER = 4.0
"""Neighbours along a row with one error, by resampling and denoising."""
OFTEN = 0.8
"""Share of the nodes that must agree: pixels at edges, beside shadows and on specks do not."""
FLAT = 0.5
"""Limit of the change of the flat membrane's light: half of what the calibration's balls leave in
contacts. Healthy frames reach 0.34."""
FULL = 0.95
"""Share of a block's nodes that must be flat and lit: the light around a contact has an error."""
BLOCK = 3
"""Squares to a side of a block: one and a half decay lengths, over which errors of the model are
alike."""
NOWHERE = (math.nan, math.nan)
ALIKE = 9.0
"""Nodes whose light one error changes alike."""
ROUNDS = 10
"""Rounds of a robust fit of one parameter."""


@dataclass(frozen=True, slots=True)
class ContactLightResidual:
    """What the surface found does not explain of the light of a contact.

    Attributes
    ----------
    stretch, stretch_sd : float
        Light of the stretched membrane over that of the model, less 1, for each unit of stretch
        (its area over the flat one's, less 1), and the standard deviation.
    spread : float
        Size of what is left on gentle slopes, in standard deviations.
    uneven : float
        Share of the slopes of a block that belongs to no surface, over what the misfit of the
        calibration's balls and the nodes explain; of the worst, over the worst expected of as many.
    worst_mm : (x, y)
        Middle of the block that fits worst, by the larger of the two.
    flat : float
        Change of the light of the flat membrane that no slope explains, as a share of it: a fifth
        of its blocks have a larger one.
    flat_mm : (x, y)
        Middle of the block that has changed most.
    light : (5, rows, columns) float32 or None
        What it was found from, as for :func:`contact_light`.
    misfit : float
        Relative misfit of the calibration's balls.
    """

    stretch: float
    stretch_sd: float
    spread: float
    uneven: float
    worst_mm: tuple[float, float] = NOWHERE
    flat: float = 0.0
    flat_mm: tuple[float, float] = NOWHERE
    light: Float32Array | None = field(default=None, repr=False, compare=False)
    misfit: float = 0.0

    @property
    def times(self) -> float:
        """How many times larger the model's errors are than in the calibration's balls, at least 1.

        As the factor of Birge widens the deviations of measurements that scatter more than stated.
        """
        return max(1.0, self.spread, self.uneven)

    @property
    def darkening(self) -> float:
        """Change of brightness by unit stretch beyond what errors of the model explain, 0..."""
        explained = CLEAR * self.stretch_sd
        return math.sqrt(max(self.stretch**2 - explained**2, 0.0))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What this says about the height map."""
        if self.flat > math.hypot(FLAT * self.misfit, ALONE * GAIN):
            x_mm, y_mm = self.flat_mm
            text = (
                f"the light of the flat membrane has changed from place to place, most at "
                f"({x_mm:.1f}, {y_mm:.1f}) mm: the camera processes its images, for example by "
                "tone mapping, its exposure has changed in mid frame, or a film lies on the "
                "membrane"
            )
            remedy = "Switch all processing of the camera off, clean the membrane, keep light out"
            return (_doubtful("flat_light", text, 100.0 * self.flat, "%", remedy),)
        if abs(self.stretch) > SIGMAS * self.stretch_sd and self.spread < SIGMAS:
            percent = 100.0 * self.stretch
            how = "darker" if percent < 0 else "brighter"
            text = (
                f"the stretched membrane is {how} than in the calibration's presses, by "
                f"{abs(percent):.0f} % where its area has doubled"
            )
            if percent < 0:
                text += ", or the camera blends in the frame before"
            remedy = "Press the balls again and calibrate, or replace a worn membrane"
            return (_doubtful("stretched", text, percent, "%", remedy),)
        worst = max(self.spread, self.uneven)
        if worst > SIGMAS:
            return (fits_no_surface(worst, self.worst_mm),)
        return ()


def largest_of(count: float) -> float:
    """Return the size that the largest of many normal values of deviation 1 has, about."""
    return math.sqrt(2.0 * math.log(count))


def fits_no_surface(times: float, place_mm: tuple[float, float]) -> Finding:
    """Return the finding that the light at a place is that of no surface.

    Parameters
    ----------
    times : float
        What is left, over what the calibration's balls leave.
    place_mm : (x, y)
        Where it is largest.
    """
    x_mm, y_mm = place_mm
    text = (
        f"the light at ({x_mm:.1f}, {y_mm:.1f}) mm fits no surface: damage or dirt, other "
        f"light or a movement leaves {times:.1f} times as much as the calibration's balls"
    )
    remedy = (
        "Clean the membrane and look for damage at this place, hold object and sensor "
        "still during the exposure, and press again"
    )
    return _doubtful("residual", text, times, "", remedy)


def contact_light(
    left: Float32Array,
    step: int,
    uneven: Float32Array,
    misfit: float,
    squares_mm: tuple[Float64Array, Float64Array],
    *,
    resolved: bool = True,
) -> ContactLightResidual:
    """Return what is left of the light of a contact.

    Parameters
    ----------
    left : (5, rows, columns) float32
        Light that no normal explains, the whole light in the same direction, its noise, all over
        the flat membrane's, the slope, and the change of the light by the contact in this
        direction; NaN where not known.
    step : int
        Distance of the rows in nodes: half the drape's decay length.
    uneven : (2, rows, columns / step) float32
        Size of the part of the slopes that belongs to no surface, and of the slopes, both averaged
        over squares; NaN where not known.
    misfit : float
        Relative misfit of the calibration's balls.
    squares_mm : (x (columns / step,), y (rows / step,))
        Middles of the squares.
    resolved : bool, optional
        Whether the nodes resolve the drape; otherwise single nodes are not judged.
    """
    solved_mask = np.isfinite(left[0])
    # Lamps are not points: beside a shadow they are hidden in part.
    around = np.ones((3, 2 * step + 1), np.uint8)
    clear = cv2.erode(solved_mask.astype(np.uint8), around, borderValue=1) > 0
    tilted = solved_mask & (left[3] > EDGES[0])
    rest, whole, noise, slope = left[:4, tilted]
    clear = clear[tilted]
    stretch = np.sqrt(1.0 + slope**2) - 1.0
    sigma = np.hypot(noise, misfit)
    kinds = np.digitize(slope, EDGES) - 1
    estimates = []
    for kind in range(len(EDGES) - 1):
        at = kinds == kind
        if at.sum() < LEAST_NODES:
            continue
        middle = np.median(rest[at])
        scatter = float(np.median(np.abs(rest[at] - middle))) / NormalDist().inv_cdf(0.75)
        at &= np.abs(rest - middle) <= SIGMAS * scatter
        share, number = float((whole[at] ** 2).mean()), np.count_nonzero(at)
        if share > 0.0:
            darker = float((rest[at] * whole[at]).mean()) / share
            variance = (misfit**2 + scatter**2 * TOGETHER / number) / share
            estimates.append((darker, float(stretch[at].mean()), variance))
    darkening, darkening_sd = _proportional(np.array(estimates).reshape(-1, 3).T)
    judged = clear & (kinds == GENTLE)
    spread, off = 0.0, np.zeros(solved_mask.shape, np.float32)
    if resolved and judged.sum() >= LEAST_NODES:
        deviation = np.abs(rest - darkening * stretch * whole)[judged] / sigma[judged]
        usual = NormalDist().inv_cdf(0.5 * (1.0 + OFTEN))
        spread = float(np.quantile(deviation, OFTEN)) / usual
        off[tuple(np.argwhere(tilted)[judged].T)] = deviation > SIGMAS
    worst, at = _worst_block(uneven, step, misfit)
    if spread > worst:
        density = cv2.boxFilter(off, -1, (BLOCK * step, BLOCK), borderType=cv2.BORDER_CONSTANT)
        row, column = np.unravel_index(density.argmax(), density.shape)
        at = int(row), int(column) // step
    x, y = squares_mm
    place = (float(x[min(at[1], x.size - 1)]), float(y[at[0]])) if max(spread, worst) else NOWHERE
    flat, at = _flat_light(left, step)
    flat_mm = (float(x[min(at[1] // step, x.size - 1)]), float(y[at[0]])) if flat else NOWHERE
    found = darkening, darkening_sd, spread, worst
    return ContactLightResidual(*found, place, flat, flat_mm, left, misfit)


def _flat_light(left: Float32Array, step: int) -> tuple[float, tuple[int, int]]:
    """Return the change of light that most blocks of flat membrane do not exceed, and the worst.

    The worst is a row and a column of `left`.
    """
    flat_mask = np.isfinite(left[0]) & (left[3] < EDGES[0])
    size = BLOCK * step, BLOCK
    off, share = (
        cv2.boxFilter(part.astype(np.float32), -1, size, borderType=cv2.BORDER_CONSTANT)
        for part in (np.where(flat_mask, left[0], np.float32(0.0)), flat_mask)
    )
    change = np.where(share > FULL, np.abs(off), np.float32(0.0))
    if np.count_nonzero(change) < LEAST_NODES * step:
        return 0.0, (0, 0)
    row, column = np.unravel_index(change.argmax(), change.shape)
    return float(np.quantile(change[change > 0.0], OFTEN)), (int(row), int(column))


def lacking_contrast(found: ContactLightResidual) -> tuple[float, float]:
    """Return the share of a frame that, as the bare membrane, explains most of what is left.

    A contact of which a share is the bare membrane looks too gentle, and no surface sends its
    light: three channels have one degree of freedom more than a normal.

    Returns
    -------
    (float, float)
        The share, and its standard deviation; infinite where it is not known.
    """
    if found.light is None:
        return 0.0, math.inf
    tilted = np.isfinite(found.light[0]) & (found.light[3] > EDGES[0])
    if np.count_nonzero(tilted) < LEAST_NODES:
        return 0.0, math.inf
    rest, _, noise, _, contrast = found.light[:, tilted].astype(np.float64)
    sigma = np.hypot(noise, found.misfit)
    rest, effect, weight, share = rest / sigma, contrast / sigma, np.ones(sigma.size), 0.0
    for _ in range(ROUNDS):
        share = -float((weight * rest * effect).sum() / (weight * effect**2).sum())
        left = rest + share * effect
        scale = SIGMAS * float(np.median(np.abs(left))) / NormalDist().inv_cdf(0.75)
        weight = 1.0 / (1.0 + (left / max(scale, 1e-9)) ** 2)
    variance = (weight * left**2).sum() / weight.sum() / (weight * effect**2).sum()
    return share, math.sqrt(ALIKE * float(variance))


def _worst_block(uneven: Float32Array, step: int, misfit: float) -> tuple[float, tuple[int, int]]:
    """Return the unevenness of the worst block over the worst expected of as many, and its middle.

    The middle is a row and a column of squares.
    """
    # Lamps are not points: beside nodes without light they are hidden in part.
    solved = np.isfinite(uneven[1]).astype(np.uint8)
    usable = cv2.erode(solved, np.ones((3, 3), np.uint8), borderValue=1) > 0
    sloped_mask = usable & (uneven[1] > EDGES[0])
    share = np.where(sloped_mask, uneven[0] / (EDGES[0] + uneven[1]), np.float32(0.0))
    count, total = (
        cv2.boxFilter(part, -1, (BLOCK, BLOCK), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for part in (sloped_mask.astype(np.float32), share)
    )
    at, blocks = count > BLOCK, np.count_nonzero(sloped_mask) / BLOCK**2
    if blocks < 2.0 or not at.any():
        return 0.0, (0, 0)
    # A slope that decays is known to within one node, over the root of 12.
    level = math.hypot(misfit, 0.5 / step / math.sqrt(12.0))
    mean = np.where(at, total / np.maximum(count, 1.0), np.float32(0.0))
    row, column = np.unravel_index(mean.argmax(), mean.shape)
    worst = float(mean[row, column]) / level / largest_of(blocks)
    return worst, (int(row), int(column))


def _proportional(seen: NDArray[np.float64]) -> tuple[float, float]:
    """Return the factor from stretch to brightness with its standard deviation.

    Where brightness is not proportional to stretch, the deviation is larger.
    """
    brighter, stretch, variance = seen
    if not brighter.size:
        return 0.0, math.inf
    weight = float((stretch**2 / variance).sum())
    factor = float((brighter * stretch / variance).sum()) / weight
    square = float(((brighter - factor * stretch) ** 2 / variance).sum())
    return factor, math.sqrt(max(square / max(brighter.size - 1, 1), 1.0) / weight)


def _doubtful(key: str, text: str, value: float, unit: str, remedy: str) -> Finding:
    heights = HeightReliability.DOUBTFUL
    return Finding(key, text, value, unit, verdict=Verdict.WARN, remedy=remedy, heights=heights)
