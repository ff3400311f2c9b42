"""The scale of a closed sensor, measured on a pressed pin grid or flat punch of known size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.geometry.fits import algebraic_sphere
from gelpolight_core.sensor.closed_sensor.working_grid import WorkingGrid, unfolded
from gelpolight_core.stages.balls.contact_contour import ImageCircle

from .contact_aspect import DOUBTFUL_SIGMAS

LEAST_PINS = 9
BLURS_PX = (2.0, 3.0, 4.5, 7.0, 10.0)
"""Smoothing of the images for the detection of pins: about half a pin's radius."""
ACROSS = 0.8
"""Least sine of the angle between the directions to the two neighbours that span the grid: more
than that of a diagonal."""
OFF_LATTICE = 0.2
"""Largest distance of a pin from the grid, as a share of the spacing."""
LEAST_ON_LATTICE = 0.7
LENS_TERMS = 3
"""Most terms of the correction of a wide lens, even powers of the distance from its axis."""
EDGE_SD_PX = 1.0
"""Standard deviation of the diameter of a single punch."""


@dataclass(frozen=True, slots=True)
class MeasuredScale:
    """Size of a camera pixel on the membrane, from images of a pressed object.

    Attributes
    ----------
    mm_per_px, sd_mm_per_px : (x, y)
        Mean over the images, and its standard deviation. Both axes have the same where they do not
        differ by more than the standard deviations allow.
    pins : int
        That were used; 0 for a punch.
    lens : tuple of float
        As of :class:`~gelpolight_core.sensor.closed_sensor.working_grid.WorkingGrid`; the scale is
        that in the middle of the image.
    """

    mm_per_px: tuple[float, float]
    sd_mm_per_px: tuple[float, float]
    pins: int = 0
    lens: tuple[float, ...] = ()

    @property
    def relative_sd(self) -> float:
        """Relative standard deviation, the larger one of both axes."""
        return float(np.divide(self.sd_mm_per_px, self.mm_per_px).max())

    @property
    def quality(self) -> QualityTable:
        """Findings on the scale, its uncertainty and the shape of the pixels."""
        more = "Add images of the pressed object, at other places"
        return judge_scale(self.mm_per_px, self.relative_sd, self.lens, more)


def judge_scale(
    mm_per_px: Sequence[float], scale_sd: float, lens: tuple[float, ...] = (), advice: str = ""
) -> QualityTable:
    """Judge a scale along x and y by its relative standard deviation.

    Sizes err by as much, and heights by twice as much: the limits are the lower ones of those of
    presses that were left out (3 % and 15 %) and of half of those of their heights (8 % and 25 %).

    Parameters
    ----------
    mm_per_px : (x, y)
        Size of a pixel.
    scale_sd : float
        Relative standard deviation.
    lens : tuple of float, optional
        As of :class:`MeasuredScale`.
    advice : str, optional
        How to lower it.
    """
    x, y = mm_per_px
    scale = [judge("mm_per_px", "Scale", x, "mm/px")]
    if lens:
        moved = "Correction of the lens at the corner of the image"
        scale.append(judge("lens_correction_percent", moved, 100.0 * sum(lens), "%"))
    if x != y:
        scale.append(judge("mm_per_px_y", "Scale along y (pixels are not square)", y, "mm/px"))
    uncertainty = judge(
        "scale_sd_percent",
        "Uncertainty of the scale",
        100.0 * scale_sd,
        "%",
        warn=3.0,
        fail=12.5,
        remedy=advice or "Measure the scale with a pin grid or a flat punch",
    )
    return QualityTable((*scale, uncertainty))


@dataclass(frozen=True, slots=True, eq=False)
class PinGrid:
    """A square grid of pins in an image.

    Attributes
    ----------
    spacing_px, sd_px : (2,) float64
        Pixels along x and along y in the distance of neighbouring pins, and the standard
        deviations.
    pins_px : (N, 2) float64
        Their centres (u, v).
    lens : tuple of float
        As of :class:`MeasuredScale`; the spacing is that in the middle of the image.
    """

    spacing_px: Float64Array
    sd_px: Float64Array
    pins_px: Float64Array
    lens: tuple[float, ...] = ()


def scale_from_pins(
    images: Sequence[Float32Array],
    background: Float32Array,
    *,
    spacing_mm: float,
    grid: WorkingGrid,
    where: str,
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
    grid : WorkingGrid
        With the membrane's part of the image.
    where : str
        Name of the images in messages.

    Raises
    ------
    InputError
        If an image shows no regular grid of at least 9 pins.
    """
    grids = [find_pins(image, background, grid=grid, where=where) for image in images]
    spacings = np.array([pins.spacing_px for pins in grids])
    mean_sd = np.mean([pins.sd_px for pins in grids], axis=0)
    mm_per_px = spacing_mm / spacings.mean(axis=0)
    sd_px = np.hypot(spacings.std(axis=0) / np.sqrt(len(grids)), mean_sd)
    relative_sd = sd_px * mm_per_px / spacing_mm
    sum_sd = float(np.hypot(*relative_sd))
    if abs(np.log(mm_per_px[1] / mm_per_px[0])) <= DOUBTFUL_SIGMAS * sum_sd:
        mm_per_px, relative_sd = np.full(2, mm_per_px.mean()), np.full(2, 0.5 * sum_sd)
    (x, y), (sd_x, sd_y) = mm_per_px.tolist(), (relative_sd * mm_per_px).tolist()
    # The lens is the same: it is taken from the image that shows most of it.
    lens = max(grids, key=lambda pins: len(pins.pins_px)).lens
    return MeasuredScale((x, y), (sd_x, sd_y), sum(len(pins.pins_px) for pins in grids), lens)


def find_pins(
    image: Float32Array, background: Float32Array, *, grid: WorkingGrid, where: str
) -> PinGrid:
    """Find the pressed square grid of pins in an image.

    Parameters
    ----------
    image, background, grid, where
        As for :func:`scale_from_pins`.

    Raises
    ------
    InputError
        If it shows no regular grid of at least 9 pins.
    """
    pressed, bare, first = grid.cut(image), grid.cut(background), np.array(grid.region[:2])
    axis_px = grid.middle_px
    fits = [_lattice(_pins(pressed, bare, blur) + first, axis_px) for blur in BLURS_PX]
    best = max(fits, key=lambda fit: len(fit.pins_px))
    if (count := len(best.pins_px)) < LEAST_PINS:
        text = f"no regular grid of 3 x 3 pins or more was found ({count} pins of one)"
        raise InputError(text, where, Remedy.STATE_SCALE)
    # Where a pin's spot is cut off on one side, its centre depends on the smoothing. The error
    # follows from the other smoothing with the nearest result, as that of one of two values.
    others = [fit.spacing_px for fit in fits if fit is not best and len(fit.pins_px)]
    deviation = np.abs(np.array(others or [best.spacing_px]) - best.spacing_px).min(axis=0)
    return replace(best, sd_px=np.hypot(best.sd_px, deviation / np.sqrt(2.0)))


def scale_from_punch(
    images: Sequence[Float32Array],
    background: Float32Array,
    *,
    diameter_mm: float,
    grid: WorkingGrid,
    where: str,
) -> MeasuredScale:
    """Return the scale from images of a pressed flat round punch.

    Parameters
    ----------
    images, background, grid, where
        As for :func:`scale_from_pins`.
    diameter_mm : float
        Diameter of the punch.

    Raises
    ------
    InputError
        If an image shows no contact.
    """
    edges = [find_punch(image, background, grid=grid, where=where) for image in images]
    widths = np.array([2.0 * edge.radius for edge in edges])
    width = float(widths.mean())
    sd_px = float(max(widths.std(), 2.0 * EDGE_SD_PX) / np.sqrt(len(widths)))
    mm_per_px = diameter_mm / width
    return MeasuredScale((mm_per_px,) * 2, (mm_per_px * sd_px / width,) * 2)


def find_punch(
    image: Float32Array, background: Float32Array, *, grid: WorkingGrid, where: str
) -> ImageCircle:
    """Find the edge of the face of a pressed flat round punch: there the membrane begins to slope.

    Parameters
    ----------
    image, background, grid, where
        As for :func:`scale_from_pins`.

    Raises
    ------
    InputError
        If the image shows no round edge.
    """
    change = np.abs(grid.cut(image) - grid.cut(background)).sum(axis=2)
    change = cv2.GaussianBlur(change, (0, 0), BLURS_PX[0])
    strongest = np.argwhere(change > 0.5 * change.max())
    reach = min(change.shape) // 2  # of the rays from the centre, two for each pixel of length
    angle = np.pi * np.arange(2 * reach) / reach
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y, x = strongest.mean(axis=0).tolist()
    edge = ImageCircle(x, y, 0.0)
    for _ in range(8):
        rays = cv2.warpPolar(
            change, (reach, 2 * reach), (edge.x, edge.y), reach, cv2.WARP_POLAR_LINEAR
        )
        radius = np.gradient(rays, axis=1).argmax(axis=1).astype(np.float64)
        points = radius[:, None] * direction
        inlier_mask = np.abs(radius - np.median(radius)) < max(0.2 * float(np.median(radius)), 1.0)
        (a, b), length = algebraic_sphere(points[inlier_mask])
        edge = ImageCircle(edge.x + float(a), edge.y + float(b), length)
    residual = np.abs(np.hypot(points[:, 0] - a, points[:, 1] - b) - edge.radius)
    if np.mean(residual < 2.0 * BLURS_PX[0]) < LEAST_ON_LATTICE:
        raise InputError("no round edge of a pressed punch was found", where, Remedy.STATE_SCALE)
    return ImageCircle(edge.x + grid.region[0], edge.y + grid.region[1], edge.radius)


def _pins(image: Float32Array, background: Float32Array, blur: float) -> Float64Array:
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
    # A pin has at least a quarter of the strength of the strongest ones.
    strong = height > 0.25 * float(np.quantile(height, 0.9))
    rows, columns = rows[strong], columns[strong]
    return np.stack(
        [
            columns
            + _offset(smooth[rows, columns - 1], smooth[rows, columns], smooth[rows, columns + 1]),
            rows
            + _offset(smooth[rows - 1, columns], smooth[rows, columns], smooth[rows + 1, columns]),
        ],
        axis=1,
    )


def _offset(before: Float32Array, peak: Float32Array, after: Float32Array) -> Float64Array:
    curvature = np.minimum(before - 2.0 * peak + after, -1e-12)
    return np.clip(0.5 * (before - after) / curvature, -0.5, 0.5).astype(np.float64)


def _lattice(pins: Float64Array, axis_px: Float64Array) -> PinGrid:
    """Return the best square grid through pins, or one without pins.

    Parameters
    ----------
    pins : (N, 2) float64
        Spots in the image.
    axis_px : (2,) float64
        Middle of the image, on the axis of the lens.
    """
    none = PinGrid(np.ones(2), np.ones(2), np.empty((0, 2)))
    index, walked = _walked(pins)
    if len(walked) < max(LEAST_PINS, LEAST_ON_LATTICE * len(pins)):
        return none
    offsets = pins[walked] - axis_px
    square = (offsets**2).sum(axis=1, keepdims=True) / (axis_px @ axis_px)
    design = np.kron(np.column_stack([index, np.ones(len(index))]), np.eye(2))
    if np.linalg.matrix_rank(design) < 6:
        return none
    best = none
    for terms in range(LENS_TERMS + 1):
        # Linear in all: a place of the grid is the pixel, corrected by the terms of the lens.
        bent = [(-offsets * square**power).ravel() for power in range(1, terms + 1)]
        full_design = np.column_stack([design, *bent])
        values = np.linalg.lstsq(full_design, offsets.ravel(), rcond=None)[0]
        residual = (offsets.ravel() - full_design @ values).reshape(-1, 2)
        freedom = max(residual.size - len(values), 1)
        covariance = np.linalg.inv(full_design.T @ full_design) * (residual**2).sum() / freedom
        if terms and abs(values[-1]) < DOUBTFUL_SIGMAS * np.sqrt(covariance[-1, -1]):
            break
        # A square grid turns both axes by the same angle: the columns are perpendicular, and as
        # long as the spacing along x and y, for pixels of any height.
        axes = values[:4].reshape(2, 2)
        spacing = np.linalg.norm(axes, axis=0)
        directions = axes / spacing
        skewed = abs(float(directions[:, 0] @ directions[:, 1])) > OFF_LATTICE
        lens = tuple(values[6:].tolist())
        if skewed or np.abs(residual).max() > OFF_LATTICE * spacing.min() or not unfolded(lens):
            continue
        parts = covariance[:4, :4].reshape(2, 2, 2, 2)
        # The spacing in the middle depends on the number of terms: one of two values.
        before = best if terms and len(best.pins_px) else None
        deviation = 0.0 if before is None else (spacing - before.spacing_px) / np.sqrt(2.0)
        sd = np.sqrt(np.einsum("ik,ikjk,jk->k", directions, parts, directions) + deviation**2)
        best = PinGrid(spacing, sd, pins[walked], lens)
    return best


def _walked(pins: Float64Array) -> tuple[Float64Array, NDArray[np.intp]]:
    """Return the place of each pin in its grid, found by steps like the one before.

    Returns
    -------
    index : (M, 2) float64
        Row and column of each pin of the grid.
    pins : (M,) intp
        Which they are.
    """
    if len(pins) < LEAST_PINS:
        return np.empty((0, 2)), np.empty(0, np.intp)
    start = int(np.linalg.norm(pins - np.median(pins, axis=0), axis=1).argmin())
    steps = np.delete(pins, start, axis=0) - pins[start]
    lengths = np.linalg.norm(steps, axis=1)
    first = steps[lengths.argmin()]
    # The nearest pin in another direction: along y pixels may have another size.
    across = np.abs(steps @ [-first[1], first[0]]) / (lengths * lengths.min())
    second = steps[np.where(across > ACROSS, lengths, np.inf).argmin()]
    pin_at = {(0, 0): start}
    walk = [((0, 0), np.stack([first, second]))]
    for (i, j), axes in walk:
        for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            step = di * axes[0] + dj * axes[1]
            distance = np.linalg.norm(pins - pins[pin_at[i, j]] - step, axis=1)
            nearest = int(distance.argmin())
            place = i + di, j + dj
            if distance[nearest] < np.linalg.norm(step) / 3.0 and place not in pin_at:
                pin_at[place] = nearest
                turned = axes.copy()
                turned[abs(dj)] = (pins[nearest] - pins[pin_at[i, j]]) * (di + dj)
                walk.append((place, turned))
    return np.array(list(pin_at), np.float64), np.array(list(pin_at.values()))
