"""How noisy a single picture is, found in the picture itself.

The checkerboard difference of 2x2 pixels cancels every smooth shading; its mean square over a block
is the variance of the block's pixels. The median over many blocks of like brightness is indifferent
to edges and specks. Membrane with a pattern as fine as a pixel would count as noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Map = NDArray[np.float32]
# 64 independent differences: a block knows its variance to 18 %, without bias in the median.
BLOCK = 16
LEVELS = 8
LEAST_BLOCKS = 12
SATURATED = 0.99
# What is darker is clipped at zero and says nothing about noise.
DARK = 0.01


@dataclass(frozen=True, slots=True)
class PictureNoise:
    """Variance of a pixel against its brightness, per channel.

    Attributes
    ----------
    levels : tuple of three (N,) arrays
        Brightness, linear light 0..1, rising.
    variance : tuple of three (N,) arrays
        Of one pixel at that brightness.
    """

    levels: tuple[Array, Array, Array]
    variance: tuple[Array, Array, Array]

    def at(self, light: Map) -> Map:
        """Return the variance (rows, columns, 3) of pixels of the given brightness."""
        return np.stack(
            [
                np.interp(light[..., k], self.levels[k], self.variance[k]).astype(np.float32)
                for k in range(3)
            ],
            axis=-1,
        )


def picture_noise(rgb: Map) -> PictureNoise:
    """Measure the noise of a raw picture.

    Parameters
    ----------
    rgb : (height, width, 3) float32
        Linear light 0..1, not resampled.
    """
    rows, columns = (n // BLOCK for n in rgb.shape[:2])
    seen = np.nan_to_num(rgb[: rows * BLOCK, : columns * BLOCK], posinf=1.0, neginf=0.0)
    check = 0.5 * (seen[::2, ::2] - seen[1::2, ::2] - seen[::2, 1::2] + seen[1::2, 1::2])
    variance = _blocks(check * check, BLOCK // 2).mean(axis=(1, 3)).reshape(-1, 3)
    whole = _blocks(seen, BLOCK)
    level = whole.mean(axis=(1, 3)).reshape(-1, 3)
    bright = whole.max(axis=(1, 3)).reshape(-1, 3)
    fits = [
        _curve(level[:, k], variance[:, k], (level[:, k] > DARK) & (bright[:, k] < SATURATED))
        for k in range(3)
    ]
    return PictureNoise((fits[0][0], fits[1][0], fits[2][0]), (fits[0][1], fits[1][1], fits[2][1]))


def _blocks(picture: Map, size: int) -> Map:
    rows, columns = picture.shape[0] // size, picture.shape[1] // size
    return picture.reshape(rows, size, columns, size, picture.shape[2])


def _curve(level: Map, variance: Map, use: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return median variances over classes of brightness with equally many blocks each."""
    level, variance = level[use].astype(np.float64), variance[use].astype(np.float64)
    if level.size < LEAST_BLOCKS:
        return np.zeros(1), np.full(1, float(np.median(variance)) if variance.size else 0.0)
    count = min(LEVELS, level.size // LEAST_BLOCKS)
    classes = np.array_split(np.argsort(level, kind="stable"), count)
    return (
        np.array([np.mean(level[c]) for c in classes]),
        np.array([np.median(variance[c]) for c in classes]),
    )
