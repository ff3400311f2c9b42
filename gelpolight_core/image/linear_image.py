"""An image as the core uses it: RGB, 0..1, linear light once the camera response is undone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.errors import InputError, Remedy

from .response import CameraResponse


@dataclass(frozen=True, slots=True)
class LinearImage:
    """One image of a stage.

    Attributes
    ----------
    name : str
        File name without its folder, such as ``ball_03.png``.
    rgb : (rows, columns, 3) float32
        Linear light, 0..1, channel k lit by LED k (red, green, blue).
    bit_depth : int
        Bits per value in the file: 8 or 16.
    frame_count : int
        Number of frames that were averaged.
    grey : bool
        Whether the file had a single channel (repeated three times in `rgb`).
    loss : float
        Standard deviation by which the compression of the file may have changed a value, in grey
        levels of 8 bit; 0 without loss.
    """

    name: str
    rgb: Float32Array
    bit_depth: int = 8
    frame_count: int = 1
    grey: bool = False
    loss: float = 0.0

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]


def require_size(size: tuple[int, int], expected: tuple[int, int], *, where: str) -> None:
    """Refuse an image that has another size than the other images.

    Parameters
    ----------
    size, expected : (int, int)
        (width, height) in pixels.
    where : str
        The image.

    Raises
    ------
    InputError
        If it differs.
    """
    if size != expected:
        pixels, instead = "x".join(map(str, size)), "x".join(map(str, expected))
        text = f"The image has {pixels} pixels instead of {instead}"
        raise InputError(text, where, Remedy.SAME_CAMERA)


def linear_image(
    rgb: NDArray[Any], name: str, *, response: CameraResponse | None = None, grey: bool = False
) -> LinearImage:
    """Convert a camera's values to linear light 0..1.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        As delivered by the camera.
    name : str
        Name of the image.
    response : CameraResponse, optional
        Response of the camera, which is corrected; without it the camera is linear.
    grey : bool, optional
        Whether the file had a single channel.
    """
    values = np.ascontiguousarray(rgb)
    full_scale = np.iinfo(values.dtype).max
    light = (
        values.astype(np.float32) / np.float32(full_scale)
        if response is None
        else response.linearise(values)
    )
    return LinearImage(name, light, bit_depth=8 * values.dtype.itemsize, grey=grey)
