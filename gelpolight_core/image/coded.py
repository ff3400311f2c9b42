"""Frames as whole numbers with a table of their linear light, for compiled loops."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array

from .response import CameraResponse

MISSING, MISSING_LIGHT = 65535, 2.0
"""Floats are held in 16 bits: the code of a value that is not finite, and its light, which counts
as saturated."""


def coded(frame: NDArray[Any]) -> tuple[NDArray[Any], bool]:
    """Return a frame as uint8 or uint16, with True if its numbers are codes of linear light."""
    if frame.dtype.kind != "f":
        # numba would compile a kernel a second time for a read-only array.
        return np.require(frame, requirements=["C", "W"]), False
    finite = np.isfinite(frame)
    code = np.clip(np.where(finite, frame, 0.0), 0.0, 1.0) * (MISSING - 1) + 0.5
    return np.where(finite, code, MISSING).astype(np.uint16), True


class LightLevels:
    """The linear light of every number of an image, computed once for each kind of image.

    Parameters
    ----------
    response : CameraResponse or None
        Response of the camera; None where its numbers are linear light already.
    """

    def __init__(self, response: CameraResponse | None) -> None:
        self._response = response
        self._known: dict[tuple[np.dtype[Any], bool], Float32Array] = {}

    def __call__(self, dtype: np.dtype[Any], linear: bool) -> Float32Array:
        """Return the light (3, levels) of uint8 or uint16, or of codes of linear light."""
        if (dtype, linear) not in self._known:
            self._known[dtype, linear] = self._light(dtype, linear)
        return self._known[dtype, linear]

    def _light(self, dtype: np.dtype[Any], linear: bool) -> Float32Array:
        top = int(np.iinfo(dtype).max)
        numbers = np.arange(top + 1).astype(dtype)
        if self._response is not None and not linear:
            linear_light = self._response.linearise(np.repeat(numbers[:, None, None], 3, axis=2))
            return np.ascontiguousarray(linear_light[:, 0].T, np.float32)
        light = numbers.astype(np.float32) / np.float32(MISSING - 1 if linear else top)
        if linear:
            light[MISSING] = MISSING_LIGHT
        return np.tile(light, (3, 1))
