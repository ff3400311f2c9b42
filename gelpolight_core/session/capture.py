"""Average camera frames of one view and write them as an image file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import make_folder, write_atomically
from gelpolight_core.translation import tr

Frame = NDArray[Any]


def average_frames(frames: Sequence[Frame]) -> Frame:
    """Return the average of frames, as 16 bit if there are several."""
    if len(frames) == 1:
        return frames[0]
    scale = 65535.0 / float(np.iinfo(frames[0].dtype).max)
    total = np.zeros(frames[0].shape, np.float64)
    for frame in frames:
        total += frame
    return np.asarray(np.round(total * (scale / len(frames))), np.uint16)


def write_image(rgb: Frame, path: Path, *, new: bool = False, inside: Path | None = None) -> None:
    """Write a PNG file, completely or not at all.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        The image.
    path : Path
        Destination; its folder is created.
    new, inside
        As in :func:`~gelpolight_core.io.atomic.write_atomically`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    make_folder(path.parent)
    done, data = cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))
    if not done:
        raise InputError(
            tr("The image cannot be encoded"), where=str(path), advice=tr("Capture it again")
        )
    write_atomically(path, lambda stream: stream.write(data.tobytes()), new=new, inside=inside)
