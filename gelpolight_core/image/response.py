"""The curve from pixel values to linear light, and the standard response curves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array

# Four nodes per 8-bit step, so that every 8-bit value is a node; between nodes a power of 2.2
# deviates from a straight line by less than a thirtieth of a 16-bit step.
NODES = 4 * 255 + 1


@dataclass(frozen=True)
class CameraResponse:
    """The inverse response of a camera that is not linear.

    Attributes
    ----------
    curves : (3, nodes) float64
        Linear light of each channel at evenly spaced encoded values 0..1, rising from 0 to 1.

    Raises
    ------
    ValueError
        If the curves have another shape, are not finite, do not rise or do not run from 0 to 1.
    """

    curves: Float64Array

    def __post_init__(self) -> None:
        """Refuse curves that are not a valid response."""
        c = self.curves
        if c.ndim != 2 or c.shape[0] != 3 or not 2 <= c.shape[1] <= 10_000:
            raise ValueError(f"the camera response has shape {c.shape}")
        if not np.isfinite(c).all() or not (np.diff(c, axis=1) > 0.0).all():
            raise ValueError("the camera response does not rise")
        if (c[:, 0] != 0.0).any() or (c[:, -1] != 1.0).any():
            raise ValueError("the camera response does not run from 0 to 1")

    @property
    def departure(self) -> float:
        """Largest distance from a straight line at the best gain, as a share of full scale."""
        straight = np.linspace(0.0, 1.0, self.curves.shape[1])
        return max(float(np.abs(curve_distance(curve, straight)).max()) for curve in self.curves)

    @cached_property
    def _of_8_bit(self) -> Float32Array:
        return self._table(256)

    @cached_property
    def _of_16_bit(self) -> Float32Array:
        return self._table(65536)

    def _table(self, levels: int) -> Float32Array:
        nodes, numbers = (np.linspace(0.0, 1.0, n) for n in (self.curves.shape[1], levels))
        light = [np.interp(numbers, nodes, curve) for curve in self.curves]
        return np.stack(light, axis=-1).astype(np.float32)

    def linearise(self, frame: NDArray[Any]) -> Float32Array:
        """Return the linear light (rows, columns, 3), 0..1, of a raw uint8 or uint16 RGB frame."""
        if frame.dtype == np.uint8:
            import cv2

            table = self._of_8_bit[None]
            return np.asarray(cv2.LUT(np.ascontiguousarray(frame), table), np.float32)
        light = np.empty(frame.shape, np.float32)
        for k in range(3):
            light[..., k] = self._of_16_bit[frame[..., k], k]
        return light


def curve_distance(light: Float64Array, other: Float64Array) -> Float64Array:
    """Return the distance of `light` from another measure of it at the best common gain.

    Parameters
    ----------
    light, other : (...)
        Linear light, of one shape.
    """
    gain = float((light * other).sum() / (other**2).sum())
    return np.asarray(light / gain - other)


def gamma_response(gamma: float) -> CameraResponse | None:
    """Return the response of a camera that encodes light to the power 1 / gamma, None for 1."""
    if gamma == 1.0:
        return None
    return _alike(np.linspace(0.0, 1.0, NODES) ** gamma)


def srgb_response() -> CameraResponse:
    """Return the response of a camera that encodes by the sRGB curve (IEC 61966-2-1)."""
    encoded = np.linspace(0.0, 1.0, NODES)
    power = ((encoded + 0.055) / 1.055) ** 2.4
    return _alike(np.where(encoded <= 0.04045, encoded / 12.92, power))


def declared_response(declared: str | float | None) -> CameraResponse | None:
    """Return the response that a session declares: ``linear``, ``srgb``, a gamma, or nothing."""
    if isinstance(declared, float):
        return gamma_response(declared)
    return srgb_response() if declared == "srgb" else None


def _alike(curve: Float64Array) -> CameraResponse:
    return CameraResponse(np.tile(curve, (3, 1)))
