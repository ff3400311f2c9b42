"""Images decoded by OpenCV."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def decoded(data: bytes) -> NDArray[Any]:
    """Return (rows, columns) grey or (rows, columns, 3) RGB values, or raise ValueError."""
    import cv2

    try:
        raw = cv2.imdecode(
            np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
        )
    except cv2.error as error:
        raise ValueError(str(error)) from error
    if raw is None or (raw.ndim == 3 and raw.shape[2] not in (3, 4)):
        raise ValueError("no grey or colour image")
    return raw if raw.ndim == 2 else np.ascontiguousarray(raw[:, :, 2::-1])
