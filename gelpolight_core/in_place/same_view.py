"""Whether a background shows the same membrane, crop and exposure as the ball images.

The median of the ball images, pressed at different places, is nearly the untouched membrane. It
must be as bright as the background. A shift of some pixels shows in the slopes of the presses that
are left out, as far as it matters: 8 px raise their error from 1.3 to 1.9 degrees on a GelSight
Mini. Texture says nothing about it, because a press can drag the texture of the gel.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

Map = NDArray[np.float32]

OFFSET = 0.02
BRIGHTER = 0.05
"""Median difference of brightness, after correction of a common gain of each channel, above which
images are of different sensors. Images of one sensor differ by 1 to 3 %, those of another by 30
%."""


def refuse_other_view(images: Sequence[Map], background: Map) -> None:
    """Refuse a background that the ball images do not belong to.

    Parameters
    ----------
    images : sequence of (rows, columns, 3) float32
        With balls at different places.
    background : (rows, columns, 3) float32
        Images that should be of the same sensor.

    Raises
    ------
    InputError
        If its brightness differs nearly everywhere.
    """
    middle = np.asarray(np.median(np.stack(images), axis=0), np.float32)
    seen, there = (cv2.GaussianBlur(a, (0, 0), 2.0) + np.float32(OFFSET)
                   for a in (middle, background))  # fmt: skip
    ratio = seen / there
    differs = float(np.median(np.abs(ratio / np.median(ratio, axis=(0, 1)) - 1.0).max(axis=2)))
    if differs > BRIGHTER:
        raise InputError(
            tr(
                "the background's brightness differs from the ball images' by {x:.0f} % (median)"
            ).format(x=100.0 * differs),
            where="background",
            advice=tr(
                "Use a background of the same gel, crop, size and exposure as the ball images"
            ),
        )
