"""Whether a background shows the same membrane, crop and exposure as the ball images.

The median of the ball images, pressed at different places, is nearly the untouched membrane. It
must be as bright as the background, and its texture must be at the same position.
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
BLOCKS = 3
REACH = 24
"""Search distance for a block of texture, in nodes."""
MOVED = 1.5
"""Displacement in nodes above which a block counts as moved."""
BETTER, GOOD = 0.15, 0.5
"""Least increase of the correlation of a moved block, and its least correlation."""
LEAST_MOVED = 2


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
        If its brightness differs nearly everywhere, or its texture is displaced.
    """
    middle = np.asarray(np.median(np.stack(images), axis=0), np.float32)
    seen, there = (cv2.GaussianBlur(a, (0, 0), 2.0) + np.float32(OFFSET)
                   for a in (middle, background))  # fmt: skip
    ratio = seen / there
    differs = float(np.median(np.abs(ratio / np.median(ratio, axis=(0, 1)) - 1.0).max(axis=2)))
    found = ""
    if differs > BRIGHTER:
        found = tr(
            "the background's brightness differs from the ball images' by {x:.0f} % (median)"
        ).format(x=100.0 * differs)
    else:
        moved = moved_blocks(middle, background)
        if len(moved) >= LEAST_MOVED:
            px = float(np.median(np.hypot(*np.array(moved).T)))
            found = tr(
                "the texture of the background is shifted by {px:.0f} px against the ball images"
            ).format(px=px)
    if found:
        raise InputError(
            found,
            where="background",
            advice=tr(
                "Use a background of the same gel, crop, size and exposure as the ball images"
            ),
        )


def moved_blocks(image: Map, background: Map) -> list[tuple[float, float]]:
    """Return the displacement (x, y) of the blocks of texture that have moved."""
    first, second = _texture(image), _texture(background)
    rows, columns = first.shape
    high, wide = (rows - 2 * REACH) // BLOCKS, (columns - 2 * REACH) // BLOCKS
    moved: list[tuple[float, float]] = []
    if min(high, wide) < REACH:
        return moved
    for i in range(BLOCKS):
        for j in range(BLOCKS):
            top, left = REACH + i * high, REACH + j * wide
            block = first[top : top + high, left : left + wide]
            around = second[top - REACH : top + high + REACH, left - REACH : left + wide + REACH]
            answer = cv2.matchTemplate(around, block, cv2.TM_CCOEFF_NORMED)
            y, x = np.unravel_index(int(answer.argmax()), answer.shape)
            best, here = float(answer[y, x]), float(answer[REACH, REACH])
            dx, dy = float(x) - REACH, float(y) - REACH
            if best > GOOD and best - here > BETTER and np.hypot(dx, dy) > MOVED:
                moved.append((dx, dy))
    return moved


def _texture(rgb: Map) -> Map:
    light = rgb.mean(axis=2)
    fine = cv2.GaussianBlur(light, (0, 0), 1.0)
    wide = cv2.GaussianBlur(light, (0, 0), 4.0)
    return np.asarray(np.clip(fine / (wide + OFFSET) - 1.0, -0.1, 0.1), np.float32)
