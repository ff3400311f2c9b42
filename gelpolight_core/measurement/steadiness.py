"""Check from the camera noise whether an object is pressed, at the right position, and still.

A press is recognised by what it changes in the image of the bare membrane. This needs no
calibration and keeps up with the camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.image.in_time import (
    BLOCK_PX,
    CONTACT_CHANGE,
    PRESSED_SHARE,
    STILL_SHARE,
    changed_blocks,
    changed_share,
)

Frame = NDArray[Any]


@dataclass(frozen=True, slots=True)
class Contact:
    """The change of an image relative to the bare membrane.

    Attributes
    ----------
    share : float
        Share of the image that is changed.
    centre_px : (float, float)
        Its middle, (u, v) in pixels; NaN where nothing is changed.
    """

    share: float
    centre_px: tuple[float, float]

    @property
    def pressed(self) -> bool:
        """Whether something is pressed."""
        return self.share >= PRESSED_SHARE

    @property
    def lifted(self) -> bool:
        """Whether the membrane is bare again."""
        return self.share < STILL_SHARE


def find_contact(bare: Frame, now: Frame) -> Contact:
    """Return what is pressed in a frame.

    Parameters
    ----------
    bare, now : (rows, columns, 3) uint8 or uint16
        The bare membrane, and the frame, of one size and depth.
    """
    changed = changed_blocks(bare, now, tolerance=CONTACT_CHANGE)
    rows, columns = np.nonzero(changed)
    if rows.size == 0:
        return Contact(0.0, (math.nan, math.nan))
    middle = 0.5 * (BLOCK_PX - 1)
    # The middle of the extent: a shadow on one side moves it less than the centroid.
    u, v = (
        float(BLOCK_PX * 0.5 * (np.percentile(c, 2) + np.percentile(c, 98)) + middle)
        for c in (columns, rows)
    )
    return Contact(float(changed.mean()), (u, v))


def judge_press(
    frames: Sequence[Frame],
    bare: Frame,
    *,
    position_px: tuple[float, float] | None = None,
    tolerance_px: float = math.inf,
) -> Finding | None:
    """Return why consecutive frames do not show a usable press; None if they do.

    Parameters
    ----------
    frames : sequence of (rows, columns, 3) uint8 or uint16
        At least two, in their order.
    bare : (rows, columns, 3)
        The bare membrane, of the same size and depth.
    position_px : (float, float), optional
        Where to press, (u, v) in pixels.
    tolerance_px : float, optional
        Largest distance of the middle of the press from it.
    """
    if len(frames) < 2:
        return _fault("one_frame", "More than one frame is needed to detect movement")
    if any(f.shape != bare.shape or f.dtype != bare.dtype for f in frames):
        text = "The camera image and the image of the bare membrane have different sizes"
        return _fault("size", text)
    contact = find_contact(bare, frames[-1])
    if not contact.pressed:
        remedy = "Press the object in until its base touches"
        return _fault("not_pressed", "Nothing is pressed", remedy=remedy)
    # From the first: between consecutive frames, slow creep is not visible.
    moving = max(changed_share(frames[0], frame) for frame in frames[1:])
    if moving > STILL_SHARE:
        percent = 100.0 * moving
        text = f"It moved: {percent:.1f} % of the image changed"
        return _fault("moved", text, percent, "%", remedy="Hold it still")
    if position_px is not None:
        away_px = math.dist(contact.centre_px, position_px)
        if away_px > tolerance_px:
            text = f"It is {away_px:.0f} pixels away from the circle"
            return _fault("away", text, away_px, "px", remedy="Move it to the circle")
    return None


def _fault(
    key: str, text: str, value: float = math.nan, unit: str = "", *, remedy: str = ""
) -> Finding:
    return Finding(key, text, value, unit, verdict=Verdict.FAIL, remedy=remedy)
