"""New camera noise for thirty images per second."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from app.sources.source import Rgb
from gelpolight_core.design.parts import CameraDesign
from gelpolight_core.simulation.compiled import compiled

Floats = NDArray[np.float32]

# Twelve random bits choose one of the midpoints of 4096 equally probable slices of the normal
# distribution, so that one 64-bit number gives five values.
_BITS = 12


def _normal_slices() -> Floats:
    count = 1 << _BITS
    values = ndtri((np.arange(count) + 0.5) / count)
    return np.asarray(values / values.std(), dtype=np.float32)


_SLICES = _normal_slices()


@dataclass(frozen=True, slots=True)
class NoiseLevel:
    """Variance of a camera's counts: ``shot * level + read``, all in the camera's own counts."""

    shot: float
    read: float

    @classmethod
    def of_camera(
        cls, camera: CameraDesign, *, gain: float = 1.0, scale: float = 1.0
    ) -> NoiseLevel:
        """Return the noise after an amplifier.

        Light and read noise are amplified alike: with gain g, a signal s has the variance
        ``g shot_variance s + (g read_sd)^2``.

        Parameters
        ----------
        camera : CameraDesign
            Noise and bit depth.
        gain : float, optional
            Gain of the amplifier.
        scale : float, optional
            Factor on the standard deviation; 0 is no noise.
        """
        full = 2.0**camera.bit_depth - 1.0
        shot = full * gain * scale**2 * camera.shot_variance
        return cls(shot, (full * gain * scale * camera.read_sd) ** 2)


@compiled
def _noisy(
    level: Any, shot: float, read: float, slices: Any, seed: Any, full: float, out: Any
) -> None:  # pragma: no cover - compiled
    for i in range(level.shape[0]):
        # Rows start far apart in a sequence of period 2^64 - 1 (xorshift64*, Vigna 2016).
        state = np.uint64(seed) + np.uint64(i + 1) * np.uint64(0x9E3779B97F4A7C15)
        state ^= state >> np.uint64(30)
        state *= np.uint64(0xBF58476D1CE4E5B9)
        state ^= state >> np.uint64(27)
        state |= np.uint64(1)
        bits = np.uint64(0)
        left = 0
        for j in range(level.shape[1]):
            if left == 0:
                state ^= state >> np.uint64(12)
                state ^= state << np.uint64(25)
                state ^= state >> np.uint64(27)
                bits = (state * np.uint64(0x2545F4914F6CDD1D)) >> np.uint64(4)
                left = 5
            normal = slices[bits & np.uint64(4095)]
            bits >>= np.uint64(12)
            left -= 1
            value = level[i, j]
            value += normal * np.sqrt(np.float32(shot) * value + np.float32(read))
            value = min(max(value + np.float32(0.5), np.float32(0.0)), np.float32(full))
            out[i, j] = np.int32(value)


def noisy(level: Floats, noise: NoiseLevel, *, seed: int, bit_depth: int) -> Rgb:
    """Return the camera's counts for a noise-free level.

    Parameters
    ----------
    level : (rows, columns[, 3]) float32
        In counts, not negative; values above full scale saturate. A grey level gives three
        channels with the same noise.
    noise : NoiseLevel
        Strength of the noise.
    seed : int
        The same seed gives the same noise.
    bit_depth : int
        8 or 16.
    """
    out = np.empty(level.shape, np.uint8 if bit_depth == 8 else np.uint16)
    rows = level.shape[0]
    _noisy(
        level.reshape(rows, -1), noise.shot, noise.read, _SLICES,
        np.uint64(seed % 2**64), 2.0**bit_depth - 1.0, out.reshape(rows, -1),
    )  # fmt: skip
    return rgb_of(out)


def rgb_of(numbers: NDArray[Any]) -> Rgb:
    """Return three channels; they are equal if the counts (rows, columns) are grey."""
    rgb = np.repeat(numbers[..., None], 3, axis=2) if numbers.ndim == 2 else numbers
    return cast(Rgb, rgb)
