"""Noise of a single image, estimated from the image itself.

The checkerboard difference of 2x2 pixels cancels every smooth shading; its mean square over a block
is the variance of the block's pixels. The median over many blocks of like brightness is indifferent
to edges and specks. Membrane with a pattern as fine as a pixel would count as noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import LEAST_LIGHT, saturated_mask
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.compiled import whole

# 64 independent differences: the variance of a block is accurate to 18 %, without bias in the
# median.
BLOCK = 16
LEAST_BLOCKS = 12


@dataclass(frozen=True, slots=True)
class ImageNoise:
    """Variance of a pixel against its brightness, per channel.

    Attributes
    ----------
    curves : three pairs of (N,) arrays
        Brightness, linear light 0..1, rising; and the variance of one pixel at that brightness.
    """

    curves: tuple[tuple[Float64Array, Float64Array], ...]

    def at(self, light: Float32Array) -> Float32Array:
        """Return the variance (3, rows, columns) of pixels of the given brightness."""
        pairs = zip(light, self.curves, strict=True)
        return np.stack([np.interp(x, *curve).astype(np.float32) for x, curve in pairs])


def image_noise(raw: NDArray[Any], light: Float32Array, workers: RowThreadPool) -> ImageNoise:
    """Measure the noise of a raw image.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        Image that was not resampled.
    light : (3, levels) float32
        Linear light 0..1 of every number; more than 1 for what is not finite.
    workers : RowThreadPool
        Threads for blocks of rows.
    """
    rows, columns = (n // BLOCK for n in raw.shape[:2])
    blocks = np.empty((3, 3, rows, columns), np.float32)
    workers.run(rows, _block_noise, raw, light, blocks)
    variance, level, bright = (part.reshape(3, -1) for part in blocks)
    use = (level > LEAST_LIGHT) & ~saturated_mask(bright)
    return ImageNoise(tuple(map(_curve, level, variance, use)))


@whole
def _block_noise(first, last, raw, light, found):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write variance, mean and maximum of blocks of pixels, block rows `first` to `last`."""
    half = np.float32(0.5)
    for i in range(first, last):
        for j in range(found.shape[3]):
            for k in range(3):
                square, total, top = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                for r in range(i * BLOCK, (i + 1) * BLOCK, 2):
                    for c in range(j * BLOCK, (j + 1) * BLOCK, 2):
                        a, b = light[k, raw[r, c, k]], light[k, raw[r, c + 1, k]]
                        d, e = light[k, raw[r + 1, c, k]], light[k, raw[r + 1, c + 1, k]]
                        check = half * (a + e - d - b)
                        square += check * check
                        total += a + b + d + e
                        top = max(top, max(max(a, b), max(d, e)))
                found[0, k, i, j] = square / np.float32(BLOCK * BLOCK // 4)
                found[1, k, i, j] = total / np.float32(BLOCK * BLOCK)
                found[2, k, i, j] = top


def _curve(
    level: Float32Array, variance: Float32Array, use: NDArray[np.bool_]
) -> tuple[Float64Array, Float64Array]:
    """Return median variances over classes of brightness with equally many blocks each."""
    level, variance = level[use].astype(np.float64), variance[use].astype(np.float64)
    if level.size < LEAST_BLOCKS:
        return np.zeros(1), np.full(1, float(np.median(variance)) if variance.size else 0.0)
    count = min(8, level.size // LEAST_BLOCKS)
    classes = np.array_split(np.argsort(level, kind="stable"), count)
    return (
        np.array([np.mean(level[c]) for c in classes]),
        np.array([np.median(variance[c]) for c in classes]),
    )
