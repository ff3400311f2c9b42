"""Keep what a camera has shown: average frames of one view, and write them as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder, write_atomically
from gelpolight_core.translation import tr

Frame = NDArray[Any]


def average_frames(frames: Sequence[Frame]) -> Frame:
    """Return the average of frames, in 16 bit where there are several.

    Parameters
    ----------
    frames : sequence of (rows, columns, 3) uint8 or uint16
        Of one view.
    """
    if len(frames) == 1:
        return frames[0]
    scale = 65535.0 / float(np.iinfo(frames[0].dtype).max)
    total = np.zeros(frames[0].shape, np.float64)
    for frame in frames:
        total += frame
    return np.asarray(np.round(total * (scale / len(frames))), np.uint16)


def write_picture(rgb: Frame, path: Path, *, new: bool = False, inside: Path | None = None) -> None:
    """Write a PNG file, whole or not at all.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        The picture.
    path : Path
        Where; its folder is made.
    new, inside
        As in :func:`~gelpolight_core.export.atomic.write_atomically`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    make_folder(path.parent)
    done, data = cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))
    if not done:
        raise InputError(
            tr("the picture cannot be encoded"), where=str(path), advice=tr("Capture it again")
        )
    write_atomically(path, lambda stream: stream.write(data.tobytes()), new=new, inside=inside)
