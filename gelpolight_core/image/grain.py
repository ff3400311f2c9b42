"""The grain of images: how alike neighbouring pixels are, compared with distant ones.

The noise of a camera is as different between neighbours as between distant pixels. Compression,
noise reduction, resizing and blur make neighbours alike. Other changes of the noise, by exposure,
gain or an average over frames, change both alike.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base import compiling
from gelpolight_core.base.arrays import Float32Array, Float64Array, Int32Array

from .change_detection import SIGMAS

FAR = 8
"""Distance of distant pixels: side of the blocks of a compressed image."""
BLOCK = 2 * FAR


@dataclass(frozen=True, slots=True)
class Grain:
    """Grain of single images at calibration, with variances in shares of full scale squared.

    Attributes
    ----------
    ratio : float
        Variance of noise between neighbours over that between distant pixels; 1 for white noise.
    near, far : float
        What the membrane's texture adds at least to the one, and at most to the other.
    sd : float
        Scatter of the variance between neighbours from image to image, as a share.
    edges : float
        Largest share of the parts of an image with more variance between neighbours where a
        compressed image's blocks meet than elsewhere.
    """

    ratio: float
    near: float
    far: float
    sd: float
    edges: float

    def lost(self, blocks: Float64Array, step: float) -> float:
        """Return the variance that neighbours lack, over the most that chance explains.

        Parameters
        ----------
        blocks : (blocks, 3)
            From :func:`block_grain`.
        step : float
            Between the numbers of the image, share of full scale.
        """
        if not len(blocks):
            return 0.0
        expected, lacking, sd = self._lacking(blocks)
        # Rounding half a step to even numbers, with little noise, rounds neighbours alike.
        rounding = step**2 / 8.0
        noise = max(float(np.median(blocks[:, 1])) - self.far - rounding, 0.0)
        alike = rounding * math.exp(-((math.pi / step) ** 2) * noise)
        return lacking / (SIGMAS * math.hypot(sd, self.sd * expected) + alike)

    def in_blocks(self, blocks: Float64Array) -> float:
        """Return the excess difference of neighbours where blocks meet, over that by chance.

        Parameters
        ----------
        blocks : (blocks, 3)
            From :func:`block_grain`; pressed parts have no blocks, either.
        """
        if not len(blocks):
            return 0.0
        return (_edges(blocks) - self.edges) / (SIGMAS * 0.5 / math.sqrt(len(blocks)))

    def _lacking(self, blocks: Float64Array) -> tuple[float, float, float]:
        """Return expected variance of neighbours, lacking part, and the sd of that."""
        near, far, _ = np.median(blocks, axis=0).tolist()
        expected = self.near + self.ratio * max(far - self.far, 0.0)
        excess = blocks[:, 0] - self.ratio * blocks[:, 1]
        # Half the distance of these quantiles is a standard deviation.
        low, high = np.quantile(excess, (0.16, 0.84))
        sd = math.sqrt(0.5 * math.pi / len(excess)) * 0.5 * float(high - low)
        return expected, expected - near, sd


def _edges(blocks: Float64Array) -> float:
    return float((blocks[:, 2] > blocks[:, 0]).mean())


def grain_of(images: Sequence[Float32Array], corner: Int32Array) -> Grain | None:
    """Return the grain of images of one sensor, pressed at different places.

    Parameters
    ----------
    images : sequence of (height, width, 3) float32
        Linear light; at least three, otherwise None is returned.
    corner : (blocks, 2) int32
        As for :func:`block_grain`.
    """
    if len(images) < 3 or not len(corner):
        return None
    light = np.tile(np.linspace(-1.0, 1.0, 65536, dtype=np.float32), (3, 1))

    def grain_in(image: Float32Array) -> Float64Array:
        code = np.rint((np.clip(image, -1.0, 1.0) + 1.0) * 32767.5).astype(np.uint16)
        return block_grain(code, light, corner)

    differences = [0.5 * grain_in(after - image) for image, after in itertools.pairwise(images)]
    noise = np.median(np.concatenate(differences), axis=0)
    blocks = [grain_in(image) for image in images]
    typical = np.median(np.concatenate(blocks), axis=0)
    ratio = float(noise[0] / max(noise[1], np.finfo(float).tiny))
    offsets = [np.median(part[:, 0] - ratio * part[:, 1]) for part in blocks]
    sd = float(np.std(offsets, ddof=1))
    margin = SIGMAS * sd / math.sqrt(len(blocks))
    near, far, _ = (typical - noise).tolist()
    share = sd / max(float(typical[0]), np.finfo(float).tiny)
    edges = max(_edges(part) for part in blocks)
    return Grain(ratio, max(near - margin, 0.0), max(far + margin, 0.0), share, edges)


def block_corners(centres: Float64Array, height: int, width: int) -> Int32Array:
    """Return corners (blocks, 2) for :func:`block_grain` about centres (blocks, 2), row and column.

    The second pixel is the first one of a block of a compressed image. There are none in an image
    that is hardly larger than a block.
    """
    max_corner = (np.array([height, width]) - BLOCK - FAR + 1) // FAR
    corners = np.clip(np.rint(centres / FAR) - 2, 0, max_corner).astype(np.int32) * FAR + FAR - 1
    return np.ascontiguousarray(corners if max_corner.min() >= 0 else corners[:0])


def block_grain(raw: NDArray[Any], light: Float32Array, corner: Int32Array) -> Float64Array:
    """Return the variance of a pixel (blocks, 3) in square parts of an image.

    By differences between neighbours, between pixels that are `FAR` apart, and between neighbours
    where four blocks of a compressed image meet. Smooth shading has no part in them.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The image.
    light : (3, levels) float32
        Linear light of every number.
    corner : (blocks, 2) int32
        Row and column of the first pixel of each part, which is `BLOCK` pixels wide.
    """
    variances = np.empty((len(corner), 3))
    _block_grain(raw, light, corner, variances)
    return variances


@compiling.part(fastmath=True)
def _square(raw, table, r, c, apart, k):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    upper = table[raw[r, c, k]] - table[raw[r, c + apart, k]]
    lower = table[raw[r + apart, c, k]] - table[raw[r + apart, c + apart, k]]
    return (upper - lower) ** 2


@compiling.whole(fastmath=True)
def _block_grain(raw, light, corner, variances):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    # The variance of each of four pixels, in three channels.
    products = np.float32(4 * 3 * FAR * FAR // 2)
    for b in range(corner.shape[0]):
        r, c = corner[b, 0], corner[b, 1]
        near, far, edges = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for k in range(3):
            table = light[k]
            for i in range(0, FAR, 2):
                for j in range(FAR):
                    # Both rows in the same block: its edges cancel.
                    near += _square(raw, table, r + 2 * i + 2, c + 2 * j, 1, k)
                    far += _square(raw, table, r + i, c + j, FAR, k)
            for i in range(0, BLOCK, FAR):
                for j in range(0, BLOCK, FAR):
                    edges += _square(raw, table, r + i, c + j, 1, k)
        variances[b, 0], variances[b, 1] = near / products, far / products
        variances[b, 2] = edges / np.float32(4 * 3 * 4)
