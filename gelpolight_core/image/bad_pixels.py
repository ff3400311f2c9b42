"""Dead and hot pixels and lines of a camera: finding them, and leaving them out of an image.

A lens spreads every point of light over neighbouring pixels. A pixel that differs from its
neighbours, which agree with each other but for one, is therefore a fault of the camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base import compiling
from gelpolight_core.base.arrays import BoolArray, Float32Array

Pixels = NDArray[np.int32]

LEAST_STEP = 0.03
"""A bad pixel differs from its neighbours by this share of full scale at least."""
OF_SPREAD = 1.5
"""... and by this multiple of the difference between these."""
LINE_SHARE = 0.5
"""A column (row) is bad where at least this share of its pixels differs from both sides."""
ACROSS, DOWN = 1, 2
FAR_SHARE = 0.05
"""Share of bad pixels from which on so many have others beside them that not all are found."""
ROUNDS = 4
"""With the bad pixels of a round left out, more of those between them are seen."""
LONGEST = 3
"""Rows and columns of the largest group of bad pixels of a camera, but for lines. Chosen: a pixel
with its neighbours."""
REST = 2
"""Pixels by which groups are widened before they are joined: not all of a hair differs enough."""
BY_CHANCE = 1e-3
"""Expected number of groups by chance below which a group is a hair: one in a thousand images."""
REACH = 12
"""Distance to the nearest good pixel above which bad pixels are not single pixels or lines."""


@dataclass(frozen=True)
class BadPixels:
    """Pixels of a camera that do not follow the light.

    Attributes
    ----------
    pixels : (N, 2) int32
        Row and column.
    height, width : int
        Size of the image.

    Raises
    ------
    ValueError
        If a place is not in the image.
    """

    pixels: Pixels
    height: int
    width: int

    def __post_init__(self) -> None:
        """Refuse positions outside the image."""
        p = self.pixels
        if p.ndim != 2 or p.shape[1] != 2 or p.dtype != np.int32:
            raise ValueError(f"bad pixels of shape {p.shape}, {p.dtype}")
        if p.size and (p.min() < 0 or (p >= np.array([self.height, self.width])).any()):
            raise ValueError("bad pixels outside the image")

    @cached_property
    def mask(self) -> BoolArray:
        """Whether a pixel is bad, (height, width)."""
        mask = np.zeros((self.height, self.width), np.bool_)
        mask[self.pixels[:, 0], self.pixels[:, 1]] = True
        return mask

    @cached_property
    def _sources(self) -> tuple[Pixels, Pixels]:
        """Return rows and columns (2, N) of the two good pixels that replace a bad one."""
        rows, columns = (np.ascontiguousarray(p, np.int64) for p in self.pixels.T)
        min_span = np.full(rows.size, np.iinfo(np.int64).max)
        sources = [np.stack([rows, rows]), np.stack([columns, columns])]
        # Where two lines cross, only the diagonals have good pixels.
        for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
            before = self._nearest(rows, columns, -down, -across)
            after = self._nearest(rows, columns, down, across)
            # At the border, the only good side of the pixel counts twice.
            before_step = np.where(before > 0, -before, after)
            after_step = np.where(after > 0, after, -before)
            span = np.where((before > 0) & (after > 0), before + after, 4 * REACH)
            span[(before == 0) & (after == 0)] = np.iinfo(np.int64).max
            nearer_mask = span < min_span
            min_span[nearer_mask] = span[nearer_mask]
            for side, step in enumerate((before_step, after_step)):
                sources[0][side, nearer_mask] = (rows + down * step)[nearer_mask]
                sources[1][side, nearer_mask] = (columns + across * step)[nearer_mask]
        return np.asarray(sources[0], np.int32), np.asarray(sources[1], np.int32)

    def _nearest(
        self, rows: NDArray[np.int64], columns: NDArray[np.int64], down: int, across: int
    ) -> NDArray[np.int64]:
        """Return the distance of the nearest good pixel in steps, 0 if there is none."""
        steps = np.zeros(rows.size, np.int64)
        for n in range(REACH, 0, -1):
            r, c = rows + n * down, columns + n * across
            inside = (r >= 0) & (r < self.height) & (c >= 0) & (c < self.width)
            good = inside.copy()
            good[inside] = ~self.mask[r[inside], c[inside]]
            steps[good] = n
        return steps

    def fill_bad_pixels(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return an image with each bad pixel replaced by the mean of good neighbours.

        Parameters
        ----------
        image : (height, width, 3)
            Any number type; it is not changed. The same image is returned if no pixel is bad.
        """
        if not self.pixels.size:
            return image
        corrected = image.copy()
        (row, other_row), (column, other_column) = self._sources
        first, second = image[row, column], image[other_row, other_column]
        mean = 0.5 * first + 0.5 * second
        # In the type of the array: integers are rounded.
        mean = np.rint(mean) if image.dtype.kind == "u" else mean
        corrected[self.pixels[:, 0], self.pixels[:, 1]] = mean.astype(image.dtype)
        return corrected


def no_bad_pixels(height: int, width: int) -> BadPixels:
    """Return that all pixels are good."""
    return BadPixels(np.zeros((0, 2), np.int32), height, width)


def find_bad_pixels(images: list[Float32Array]) -> BadPixels:
    """Return the pixels and lines that differ from their neighbours in each image.

    Dirt differs, too, but in one scene only, and it covers more than a pixel.

    Parameters
    ----------
    images : list of (height, width, 3) float32
        Different scenes of one camera, linear light 0..1, each the mean of several frames.
    """
    height, width = images[0].shape[:2]
    bad = np.ones((height, width), np.bool_)
    light = np.tile(np.linspace(0.0, 1.0, 65536, dtype=np.float32), (3, 1))
    for image in images:
        code = np.rint(np.clip(np.nan_to_num(image), 0.0, 1.0) * 65535.0).astype(np.uint16)
        bad &= isolated_pixels(code, light, noise=0.0).mask
    return BadPixels(np.argwhere(bad).astype(np.int32), height, width)


def isolated_pixels(raw: NDArray[Any], light: Float32Array, *, noise: float) -> BadPixels:
    """Return the pixels and lines of one image that differ from their neighbours.

    Parameters
    ----------
    raw, light, noise
        As for :func:`differing_pixels`.
    """
    height, width = raw.shape[:2]
    pixels = no_bad_pixels(height, width)
    for share in (1.0, *[0.0] * ROUNDS):
        corrected, rows = pixels.fill_bad_pixels(raw), np.arange(height)
        marks = differing_pixels(corrected, light, rows, noise=noise, share=share)
        bad = marks == (ACROSS | DOWN)
        bad[:, bad_lines(marks, ACROSS)] = True
        bad[bad_lines(marks.T, DOWN), :] = True
        if not bad.any():
            break
        pixels = BadPixels(np.argwhere(bad | pixels.mask).astype(np.int32), height, width)
    return pixels


def bad_lines(marks: NDArray[np.uint8], side: int) -> NDArray[np.intp]:
    """Return the columns of `marks` most of whose pixels differ from both neighbours.

    Neighbouring bad lines would be texture: the bad lines of a camera are single.
    """
    if not marks.any():
        return np.zeros(0, np.intp)
    return np.flatnonzero(((marks & side) > 0).sum(axis=0) >= LINE_SHARE * len(marks))


def threads_of(bad: BadPixels, columns: NDArray[np.intp], rows: NDArray[np.intp]) -> BoolArray:
    """Return the mask (height, width) of bad pixels that are no fault of a camera.

    Bad pixels lie anywhere. A hair or a scratch is a chain of them that is longer than a group of
    bad pixels, in both directions, and than chance explains. It may have gaps.

    Parameters
    ----------
    bad : BadPixels
        Of one image.
    columns, rows : array of int
        Its bad lines.
    """
    mask = bad.mask.copy()
    mask[:, columns] = False
    mask[rows, :] = False
    joined = cv2.dilate(mask.astype(np.uint8), np.ones((1 + 2 * REST, 1 + 2 * REST), np.uint8))
    groups, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=4)
    size = np.bincount(labels[mask], minlength=groups)
    long = np.minimum(stats[:, 2], stats[:, 3]) - 2 * REST > LONGEST
    around = (1 + 4 * REST) ** 2 - 1
    by_chance = size.sum() * min(around * mask.mean(), 1.0) ** np.maximum(size - 1.0, 0.0)
    return np.asarray((long & (by_chance < BY_CHANCE))[labels] & mask)


def differing_pixels(
    raw: NDArray[Any],
    light: Float32Array,
    rows: NDArray[np.intp],
    *,
    noise: float,
    share: float = 1.0,
) -> NDArray[np.uint8]:
    """Return which pixels of some rows differ from their neighbours.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The image, writeable and contiguous.
    light : (3, levels) float32
        Linear light of every number.
    rows : (N,) int
        The rows that are checked.
    noise : float
        Standard deviation of a pixel, share of full scale.
    share : float, optional
        Share of the neighbours' light by which a pixel like one of them differs. No speck of the
        membrane doubles the light; where pixels are known to be bad, 0 finds them all.

    Returns
    -------
    (N, width) uint8
        `ACROSS`: it differs from the pixels beside it; `DOWN`: from those above and below.
    """
    marks = np.zeros((len(rows), raw.shape[1]), np.uint8)
    if min(raw.shape[:2]) > 4:
        min_step = np.float32(max(LEAST_STEP, 8.0 * noise))
        _differing(raw, light, np.asarray(rows, np.int64), min_step, np.float32(share), marks)
    return marks


@compiling.part(fastmath={"nsz", "arcp", "contract"})
def _differs(p, a, b, c, d, min_step, share):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return whether p is far from a, b, c and d, which agree, or by more from all but one."""
    low, high = min(min(a, b), min(c, d)), max(max(a, b), max(c, d))
    factor = np.float32(OF_SPREAD)
    limit = min_step + factor * (high - low)
    if p > high + limit or p < low - limit:
        return True
    inner_1, inner_2 = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    inner_low, inner_high = min(inner_1, inner_2), max(inner_1, inner_2)
    above = inner_high + max(min_step, share * inner_high) + factor * (inner_high - low)
    below = inner_low - max(min_step, share * inner_low) - factor * (high - inner_low)
    return p > above or p < below


@compiling.whole(fastmath={"nsz", "arcp", "contract"})
def _differing(raw, light, rows, min_step, share, marks):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the marks of some rows, except for the outermost two pixels."""
    height, width = raw.shape[0], raw.shape[1]
    for i in range(rows.size):
        r = rows[i]
        inner = 2 <= r < height - 2
        for c in range(2, width - 2):
            mark = 0
            for k in range(3):
                p = light[k, raw[r, c, k]]
                a, d = light[k, raw[r, c - 1, k]], light[k, raw[r, c + 1, k]]
                # Most pixels are like the one before. Of several alike, the first is found.
                if abs(p - a) > min_step:
                    b, e = light[k, raw[r, c - 2, k]], light[k, raw[r, c + 2, k]]
                    if _differs(p, b, a, d, e, min_step, share):
                        mark |= ACROSS
                if inner:
                    a, d = light[k, raw[r - 1, c, k]], light[k, raw[r + 1, c, k]]
                    if abs(p - a) > min_step:
                        b, e = light[k, raw[r - 2, c, k]], light[k, raw[r + 2, c, k]]
                        if _differs(p, b, a, d, e, min_step, share):
                            mark |= DOWN
            marks[i, c] = mark
