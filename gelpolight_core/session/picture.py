"""A picture as the core sees it: RGB, 0..1, linear light once the camera's response is undone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
