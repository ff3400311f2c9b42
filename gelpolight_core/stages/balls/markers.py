"""Markers printed on the membrane: found by their regular pattern, excluded, and filled.

Many gels carry a grid of dark dots. A dot moves with the membrane when something is pressed in. It
then differs from the background at its old and its new position, more strongly than the shading.
Every step that compares an image with the background has to leave the dots out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array

_LEAST_MARKERS = 12
_DARKER_BY = 0.15
# Dots of one print are alike; dust and scratches are not.
_SIZE_FACTOR = 3.0
_LEAST_ALIKE = 0.5
# Perspective and a curved gel bend a row by less than this share of the distance.
_ROW_TOLERANCE = 0.25
_LEAST_IN_ROWS = 0.5


@dataclass(frozen=True, slots=True)
class Markers:
    """Markers printed on a membrane, as seen in an image without contact.

    Attributes
    ----------
    mask : (rows, columns) bool
        The markers with their soft edges; all False on a plain gel.
    centres_px : (N, 2) float64
        (x, y) of each marker.
    diameter_px : float
        Typical diameter; 0 on a plain gel.
    """

    mask: BoolArray
    centres_px: Float64Array
    diameter_px: float

    def __bool__(self) -> bool:
        """Return whether the gel carries markers."""
        return len(self.centres_px) > 0

    def covered(self, image: Float32Array) -> BoolArray:
        """Return where a marker hides the membrane, in the background or in an image with contact.

        Parameters
        ----------
        image : (rows, columns, 3) float32
            With contact; the markers have moved with the membrane.

        Returns
        -------
        (rows, columns) bool
            The markers of the background and the dots of about their size in `image`.
        """
        if not self:
            return self.mask
        dark, factor = _darker_than_around(image, self.diameter_px)
        spots = _spots(dark)
        area = np.pi * (0.5 * self.diameter_px / factor) ** 2
        moved = (spots.area > 0.2 * area) & (spots.area < 4.0 * area)
        keep = np.concatenate([[False], moved])[spots.labels]
        return np.asarray(self.mask | _grown(keep, self.mask.shape, factor))


def find_markers(background: Float32Array, valid: BoolArray | None = None) -> Markers:
    """Find the markers printed on a membrane.

    Dark spots count as markers only where there are a dozen or more of about one size and in
    rows. Dust, scratches and the texture of the membrane are therefore not markers.

    Parameters
    ----------
    background : (rows, columns, 3) float32
        Image without contact, RGB, 0..1.
    valid : (rows, columns) bool, optional
        The working area; by default the whole image.

    Returns
    -------
    Markers
        Empty on a plain gel.
    """
    shape = background.shape[0], background.shape[1]
    for share in (1.0 / 16.0, 1.0 / 32.0):
        dark, factor = _darker_than_around(background, 0.5 * share * max(shape))
        if valid is not None:
            valid_small = cv2.resize(valid.astype(np.uint8), dark.shape[::-1]) > 0
            dark = np.where(valid_small, dark, np.float32(0.0))
        markers = _regular(_spots(dark), shape, factor)
        if markers:
            return markers
    return Markers(np.zeros(shape, np.bool_), np.empty((0, 2)), 0.0)


def inpaint(values: Float32Array, holes: BoolArray) -> Float32Array:
    """Fill holes smoothly from the pixels around them.

    Averages of the known pixels on coarser and coarser grids; each hole takes the finest one that
    reaches it ("pull-push" of Gortler et al., The Lumigraph, 1996).

    Parameters
    ----------
    values : (rows, columns, channels) float32
        The image.
    holes : (rows, columns) bool
        Which pixels to fill.

    Returns
    -------
    (rows, columns, channels) float32
        A copy with the holes filled; `values` itself where there are none.
    """
    if not holes.any():
        return values
    valid = (~holes).astype(np.float32)
    sums, weights = [values * valid[..., None]], [valid]
    while min(weights[-1].shape) > 2 and len(weights) < 8:
        rows, columns = weights[-1].shape
        smaller = np.asarray(cv2.pyrDown(sums[-1]), np.float32)
        sums.append(smaller.reshape(-(-rows // 2), -(-columns // 2), -1))
        weights.append(np.asarray(cv2.pyrDown(weights[-1]), np.float32))
    coarse = sums[-1] / np.maximum(weights[-1], 1e-6)[..., None]
    for total, weight in zip(reversed(sums[:-1]), reversed(weights[:-1]), strict=True):
        size = weight.shape[1], weight.shape[0]
        larger = np.atleast_3d(cv2.resize(coarse, size, interpolation=cv2.INTER_LINEAR))
        share = np.minimum(weight, 1.0)[..., None]
        average = total / np.maximum(weight, 1e-6)[..., None]
        coarse = share * average + (1.0 - share) * larger.reshape(average.shape)
    return np.asarray(np.where(holes[..., None], coarse, values), np.float32)


@dataclass(frozen=True, slots=True)
class _MarkerSpots:
    labels: NDArray[np.int32]
    area: Float64Array
    centre: Float64Array
    fullness: Float64Array
    shape: tuple[int, int]


def _darker_than_around(image: Float32Array, diameter_px: float) -> tuple[Float32Array, int]:
    """Return by which share each pixel is darker than its surroundings, and the grid's factor."""
    # A coarser grid of at most 480 pixels.
    factor = max(1, -(-max(image.shape[:2]) // 480))
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.float32)
    if factor > 1:
        size = image.shape[1] // factor, image.shape[0] // factor
        grey = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))
    grey = np.asarray(cv2.GaussianBlur(grey, (0, 0), 0.7))
    width = 2 * round(0.9 * diameter_px / factor) + 3
    closed = np.asarray(cv2.morphologyEx(grey, cv2.MORPH_CLOSE, np.ones((width, width), np.uint8)))
    return np.asarray((closed - grey) / np.maximum(closed, np.float32(0.02))), factor


def _spots(dark: Float32Array) -> _MarkerSpots:
    _, labels, stats, centres = cv2.connectedComponentsWithStats(
        (dark > _DARKER_BY).astype(np.uint8)
    )
    longer = np.maximum(stats[1:, cv2.CC_STAT_WIDTH], stats[1:, cv2.CC_STAT_HEIGHT])
    area = stats[1:, cv2.CC_STAT_AREA].astype(np.float64)
    fullness = area / np.maximum(longer, 1).astype(np.float64) ** 2
    return _MarkerSpots(
        np.asarray(labels, np.int32),
        area,
        np.asarray(centres[1:], np.float64),
        fullness,
        dark.shape,
    )


def _regular(spots: _MarkerSpots, shape: tuple[int, int], factor: int) -> Markers | None:
    """Return the spots that form a print, or None."""
    round_mask = (spots.fullness > 0.4) & (spots.area >= 4.0)
    if np.count_nonzero(round_mask) < _LEAST_MARKERS:
        return None
    typical = float(np.median(spots.area[round_mask]))
    alike_mask = (
        round_mask & (spots.area > typical / _SIZE_FACTOR) & (spots.area < typical * _SIZE_FACTOR)
    )
    count = int(np.count_nonzero(alike_mask))
    if count < _LEAST_MARKERS or count < _LEAST_ALIKE * np.count_nonzero(spots.area >= 4.0):
        return None
    centres = spots.centre[alike_mask]
    if not _in_rows(centres):
        return None
    # Markers cover at most half of the gel.
    if spots.area[alike_mask].sum() > 0.5 * spots.labels.size:
        return None
    # The outermost dots of a print can be cut or merged; they hide the membrane, too.
    print_like = (spots.area > 0.2 * typical) & (spots.area < 6.0 * typical)
    keep = np.concatenate([[False], print_like])[spots.labels]
    offset = 0.5 * (factor - 1)
    return Markers(
        _grown(keep, shape, factor),
        centres * factor + offset,
        factor * 2.0 * float(np.sqrt(typical / np.pi)),
    )


def _in_rows(centres: Float64Array) -> bool:
    """Return whether the spots lie in rows.

    In a row, the nearest spot has a counterpart at the same distance on the other side. Of random
    spots, fewer than one in ten has one.
    """
    offsets_px = centres[None] - centres[:, None]
    distances_px = np.hypot(offsets_px[..., 0], offsets_px[..., 1])
    np.fill_diagonal(distances_px, np.inf)
    nearest = distances_px.argmin(axis=1)
    nearest_px = distances_px.min(axis=1)
    opposite = centres - offsets_px[np.arange(len(centres)), nearest]
    misses_px = np.hypot(*(opposite[:, None] - centres[None]).transpose(2, 0, 1)).min(axis=1)
    return bool(np.mean(misses_px < _ROW_TOLERANCE * nearest_px) >= _LEAST_IN_ROWS)


def _grown(keep: BoolArray, shape: tuple[int, ...], factor: int) -> BoolArray:
    """Return a mask at full size, with the soft edge of the dots."""
    large = np.zeros(shape, np.uint8)
    scaled = np.repeat(np.repeat(keep.astype(np.uint8), factor, axis=0), factor, axis=1)
    large[: scaled.shape[0], : scaled.shape[1]] = scaled
    if scaled.shape != shape:
        rows, columns = scaled.shape
        large[rows:, :columns] = scaled[-1:, :]
        large[:, columns:] = large[:, columns - 1 : columns]
    width = 4 * factor + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    return np.asarray(cv2.dilate(large, disc) > 0)
