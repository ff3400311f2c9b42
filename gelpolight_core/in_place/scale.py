"""The scale of a closed sensor, measured on a pressed pin grid or flat punch of known size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.reflectance.contour import Circle
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
Map = NDArray[np.float32]

LEAST_PINS = 9
BLURS_PX = (2.0, 3.0, 4.5, 7.0)
"""Smoothing of the images for the detection of pins: about half a pin's radius."""
LEAST_PEAK = 0.25
"""Least strength of a pin as a share of the strongest one."""
OFF_LATTICE = 0.2
"""Largest distance of a pin from the grid, as a share of the spacing."""
LEAST_ON_LATTICE = 0.7
EDGE_SD_PX = 1.0
"""Standard deviation of the diameter of a single punch."""


@dataclass(frozen=True, slots=True)
class MeasuredScale:
    """Size of a camera pixel on the membrane.

    Attributes
    ----------
    mm_per_px : float
        Mean over the images.
    sd_mm_per_px : float
        Standard deviation of that mean.
    pins : int
        That were used; 0 for a punch.
    """

    mm_per_px: float
    sd_mm_per_px: float
    pins: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class PinGrid:
    """A square grid of pins in an image.

    Attributes
    ----------
    spacing_px, sd_px : float
        Between neighbouring pins, and its standard deviation.
    pins_px : (N, 2) float64
        Their centres (u, v).
    """

    spacing_px: float
    sd_px: float
    pins_px: Array


def scale_from_pins(
    images: Sequence[Map], background: Map, *, spacing_mm: float, where: str = "scale"
) -> MeasuredScale:
    """Return the scale from images of a pressed square grid of pins.

    Parameters
    ----------
    images : sequence of (height, width, 3) float32
        Linear light.
    background : (height, width, 3) float32
        The untouched membrane.
    spacing_mm : float
        Between neighbouring pins.
    where : str, optional
        Name of the images in messages.

    Raises
    ------
    InputError
        If an image shows no regular grid of at least 9 pins.
    """
    grids = [find_pins(image, background, where=where) for image in images]
    spacings = [grid.spacing_px for grid in grids]
    spacing = float(np.mean(spacings))
    between = float(np.std(spacings)) / np.sqrt(len(grids))
    within = np.mean([grid.sd_px for grid in grids]) / np.sqrt(len(grids))
    sd = float(np.hypot(between, within)) / spacing
    count = sum(len(grid.pins_px) for grid in grids)
    return MeasuredScale(spacing_mm / spacing, sd * spacing_mm / spacing, count)


def find_pins(image: Map, background: Map, *, where: str = "scale") -> PinGrid:
    """Find the pressed square grid of pins in an image.

    Parameters
    ----------
    image, background, where
        As for :func:`scale_from_pins`.

    Raises
    ------
    InputError
        If it shows no regular grid of at least 9 pins.
    """
    fits = [_lattice(_pins(image, background, blur)) for blur in BLURS_PX]
    found = max(fits, key=lambda fit: len(fit.pins_px))
    if (count := len(found.pins_px)) < LEAST_PINS:
        raise InputError(
            tr("no regular grid of 3 x 3 pins or more was found ({n} pins of one)").format(n=count),
            where=where,
            advice=Remedy.STATE_SCALE,
        )
    return found


def scale_from_punch(
    images: Sequence[Map], background: Map, *, diameter_mm: float, where: str = "scale"
) -> MeasuredScale:
    """Return the scale from images of a pressed flat round punch.

    Parameters
    ----------
    images, background, where
        As for :func:`scale_from_pins`.
    diameter_mm : float
        Of the punch.

    Raises
    ------
    InputError
        If an image shows no contact.
    """
    edges = [find_punch(image, background, where=where) for image in images]
    widths = np.array([2.0 * edge.radius for edge in edges])
    width = float(widths.mean())
    sd_px = float(max(widths.std(), 2.0 * EDGE_SD_PX) / np.sqrt(len(widths)))
    return MeasuredScale(diameter_mm / width, diameter_mm / width * sd_px / width)


def find_punch(image: Map, background: Map, *, where: str = "scale") -> Circle:
    """Find the edge of the face of a pressed flat round punch: there the membrane begins to slope.

    Parameters
    ----------
    image, background, where
        As for :func:`scale_from_pins`.

    Raises
    ------
    InputError
        If the image shows no round edge.
    """
    change = cv2.GaussianBlur(np.abs(image - background).sum(axis=2), (0, 0), BLURS_PX[0])
    strong = np.argwhere(change > 0.5 * change.max())
    reach = min(change.shape) // 2  # of the rays from the centre, two for each pixel of length
    angle = np.pi * np.arange(2 * reach) / reach
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y, x = strong.mean(axis=0).tolist()
    found = Circle(x, y, 0.0)
    for _ in range(8):
        rays = cv2.warpPolar(
            change, (reach, 2 * reach), (found.x, found.y), reach, cv2.WARP_POLAR_LINEAR
        )
        radius = np.gradient(rays, axis=1).argmax(axis=1).astype(np.float64)
        points = radius[:, None] * direction
        near = np.abs(radius - np.median(radius)) < max(0.2 * float(np.median(radius)), 1.0)
        # x² + y² = 2 a x + 2 b y + c
        design = np.column_stack([2.0 * points[near], np.ones(np.count_nonzero(near))])
        a, b, c = np.linalg.lstsq(design, (points[near] ** 2).sum(axis=1), rcond=None)[0]
        found = Circle(found.x + float(a), found.y + float(b), float(np.sqrt(c + a * a + b * b)))
    off = np.abs(np.hypot(points[:, 0] - a, points[:, 1] - b) - found.radius)
    if np.mean(off < 2.0 * BLURS_PX[0]) < LEAST_ON_LATTICE:
        raise InputError(
            tr("no round edge of a pressed punch was found"), where=where, advice=Remedy.STATE_SCALE
        )
    return found


def _pins(image: Map, background: Map, blur: float) -> Array:
    """Return the centres (N, 2) of spots where the membrane has changed most, pixels."""
    change = np.abs(image - background).sum(axis=2)
    smooth = cv2.GaussianBlur(change, (0, 0), blur) - cv2.GaussianBlur(change, (0, 0), 3.0 * blur)
    reach = 2 * round(2.0 * blur) + 1
    peak = (smooth == cv2.dilate(smooth, np.ones((reach, reach), np.uint8))) & (smooth > 0.0)
    rows, columns = np.nonzero(peak)
    inner = (rows > 1) & (columns > 1) & (rows < len(smooth) - 2) & (columns < smooth.shape[1] - 2)
    rows, columns = rows[inner], columns[inner]
    if not rows.size:
        return np.empty((0, 2))
    height = smooth[rows, columns]
    strong = height > LEAST_PEAK * float(np.quantile(height, 0.9))
    rows, columns = rows[strong], columns[strong]
    return np.stack(
        [
            columns + _offset(smooth[rows, columns - 1], smooth[rows, columns],
                              smooth[rows, columns + 1]),
            rows + _offset(smooth[rows - 1, columns], smooth[rows, columns],
                           smooth[rows + 1, columns]),
        ],
        axis=1,
    )  # fmt: skip


def _offset(before: Map, at: Map, after: Map) -> Array:
    bend = np.minimum(before - 2.0 * at + after, -1e-12)
    return np.clip(0.5 * (before - after) / bend, -0.5, 0.5).astype(np.float64)


def _lattice(pins: Array) -> PinGrid:
    """Return the best square grid through pins; one without pins if there is none."""
    none = PinGrid(1.0, 1.0, np.empty((0, 2)))
    if len(pins) < LEAST_PINS:
        return none
    gaps = np.linalg.norm(pins[:, None] - pins[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    nearest = gaps.argmin(axis=1)
    middle = pins[int(gaps.min(axis=1).argmin())]
    start = int(np.linalg.norm(pins - np.median(pins, axis=0), axis=1).argmin())
    middle, first = pins[start], pins[nearest[start]] - pins[start]
    axes = np.stack([first, [-first[1], first[0]]])
    on = np.zeros(len(pins), np.bool_)
    for reach in (1.6, 3.2, 6.4, 100.0):
        index = (pins - middle) @ np.linalg.inv(axes)
        whole = np.rint(index)
        near = np.abs(whole).max(axis=1) < reach
        on = near & (np.abs(index - whole).max(axis=1) < OFF_LATTICE)
        if np.count_nonzero(on) < 4 or np.linalg.matrix_rank(whole[on]) < 2:
            return none
        # One spacing and direction for both axes, and an origin: a similarity.
        a, b = whole[on].T
        one, zero = np.ones_like(a), np.zeros_like(a)
        design = np.concatenate(
            [np.stack([a, -b, one, zero], axis=1), np.stack([b, a, zero, one], axis=1)]
        )
        target = np.concatenate([pins[on, 0], pins[on, 1]])
        (c, s, x, y), *_ = np.linalg.lstsq(design, target, rcond=None)
        axes, middle = np.array([[c, s], [-s, c]]), np.array([x, y])
    if np.count_nonzero(on) < LEAST_ON_LATTICE * len(pins):
        return none
    spacing = float(np.hypot(*axes[0]))
    left = design @ np.array([c, s, x, y]) - target
    covariance = np.linalg.inv(design.T @ design) * float(left @ left) / max(len(target) - 4, 1)
    return PinGrid(spacing, float(np.sqrt(covariance[0, 0])), pins[on])
