"""Images decoded by OpenCV."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy


def decoded(data: bytes, path: Path, *, indexed: bool = False, cmyk: bool = False) -> NDArray[Any]:
    """Return an image as (rows, columns) grey or (rows, columns, 3) RGB values.

    Parameters
    ----------
    data : bytes
        Content of the file.
    path : Path
        Named in a refusal.
    indexed : bool, optional
        Whether the file has a palette.
    cmyk : bool, optional
        Whether the file has the colours of a printer.

    Raises
    ------
    ValueError
        If the file is damaged.
    InputError
        If its colours are not those of the camera. The greys of a palette are.
    """
    import cv2

    if cmyk:
        text = "The image has the four inks of a printer (CMYK), not red, green and blue"
        raise InputError(text, path, Remedy.SAVE_RGB)
    try:
        raw = cv2.imdecode(
            np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
        )
    except cv2.error as error:
        raise ValueError(str(error)) from error
    if raw is None or (raw.ndim == 3 and raw.shape[2] not in (3, 4)):
        raise ValueError("no grey or colour image")
    values = raw if raw.ndim == 2 else np.ascontiguousarray(raw[:, :, 2::-1])
    if indexed and values.ndim == 3 and (values != values[..., :1]).any():
        text = "The image has a palette of at most 256 colours, to which its own were rounded"
        raise InputError(text, path, Remedy.SAVE_RGB)
    return values
