"""A picture as the core sees it: RGB, 0..1, linear light once the camera's response is undone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.response.curve import CameraResponse

FloatArray = NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of a stage.

    Attributes
    ----------
    name : str
        File name without its folder, such as ``ball_03.png``.
    rgb : (rows, columns, 3) float32
        Linear light, 0..1, channel k lit by LED k (red, green, blue).
    bit_depth : int
        8 or 16: how finely the file was quantised.
    frame_count : int
        How many frames were averaged.
    grey : bool
        Whether the file held one channel only (repeated three times in `rgb`).
    """

    name: str
    rgb: NDArray[np.float32]
    bit_depth: int = 8
    frame_count: int = 1
    grey: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]


def linear_picture(
    rgb: NDArray[Any], name: str, *, response: CameraResponse | None = None, grey: bool = False
) -> Picture:
    """Return a camera's values as linear light 0..1.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        As the camera gave it.
    name : str
        What it is called.
    response : CameraResponse, optional
        Of the camera, to be undone; left out, the camera is linear.
    grey : bool, optional
        Whether it had one channel only.
    """
    values = np.ascontiguousarray(rgb)
    full_scale = np.iinfo(values.dtype).max
    light = (
        values.astype(np.float32) / np.float32(full_scale)
        if response is None
        else response.linearise(values)
    )
    return Picture(name, light, bit_depth=8 * values.dtype.itemsize, grey=grey)
