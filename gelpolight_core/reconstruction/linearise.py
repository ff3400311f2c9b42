"""Images as linear light."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.image.response import CameraResponse


def as_linear(frame: NDArray[Any]) -> NDArray[np.float32]:
    """Return a frame of linear light as float32, 0..1, from any number type."""
    scale = 1.0 if frame.dtype.kind == "f" else 1.0 / np.iinfo(frame.dtype).max
    return np.asarray(frame, np.float32) * np.float32(scale)


def linearise_frame(frame: NDArray[Any], response: CameraResponse | None) -> NDArray[Any]:
    """Return a frame with the camera's response corrected, if it is in whole numbers."""
    return frame if response is None or frame.dtype.kind == "f" else response.linearise(frame)
