"""Check from the camera noise whether an object is pressed, at the right position, and still.

A press is recognised by what it changes in the image of the bare membrane. This needs no
calibration and keeps up with the camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.session.movement import BLOCK_PX, MOVING_SHARE, changed_blocks, moving_share
from gelpolight_core.translation import tr

Frame = NDArray[Any]

CONTACT_CHANGE = 0.06
"""The walls of a press change the light by tens of percent, warming LEDs by one or two."""
PRESSED_SHARE = 0.004
"""A cylinder of 3 mm and 0.5 mm height changes a hundredth of an image 30 mm wide."""
LIFTED_SHARE = 0.001


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
        return self.share < LIFTED_SHARE


@dataclass(frozen=True, slots=True)
class PressJudgement:
    """Whether frames show a press that can be used.

    Attributes
    ----------
    accepted : bool
        Whether they do.
    reason : str
        Why not, and what to do; empty when accepted.
    moving_share : float
        Largest share of the image that changed between two of the frames.
    contact : Contact
        What is pressed.
    """

    accepted: bool
    reason: str
    moving_share: float
    contact: Contact

    @property
    def moved(self) -> bool:
        """Whether it was moving; false if this is unknown."""
        return self.moving_share > MOVING_SHARE


def find_contact(bare: Frame, now: Frame) -> Contact:
    """Return what is pressed in a frame.

    Parameters
    ----------
    bare, now : (rows, columns, 3) uint8 or uint16
        The bare membrane, and the frame, of one size and depth.
    """
    changed = changed_blocks(bare, now, flicker=CONTACT_CHANGE)
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
) -> PressJudgement:
    """Check whether consecutive frames show a press without movement.

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
    nowhere = Contact(0.0, (math.nan, math.nan))
    if len(frames) < 2:
        return PressJudgement(
            False, tr("More than one frame is needed to detect movement."), math.nan, nowhere
        )
    if any(f.shape != bare.shape or f.dtype != bare.dtype for f in frames):
        reason = tr("The camera image and the image of the bare membrane have different sizes.")
        return PressJudgement(False, reason, math.nan, nowhere)
    # Also the first and the last frame: between consecutive frames, slow creep is not visible.
    pairs = [*pairwise(frames), (frames[0], frames[-1])]
    moving = max(moving_share(*pair) for pair in pairs)
    contact = find_contact(bare, frames[-1])
    reason = _reason(contact, moving, position_px, tolerance_px)
    return PressJudgement(not reason, reason, moving, contact)


def _reason(
    contact: Contact, moving: float, position_px: tuple[float, float] | None, tolerance_px: float
) -> str:
    """Return why a press is refused; empty where it is not."""
    if not contact.pressed:
        return tr("Nothing is pressed: press the object in until its base touches.")
    if moving > MOVING_SHARE:
        return tr("It moved ({share:.1f} % of the image changed): hold it still.").format(
            share=100.0 * moving
        )
    if position_px is not None:
        away = math.dist(contact.centre_px, position_px)
        if away > tolerance_px:
            return tr("It is {px:.0f} pixels away from the circle: move it to the circle.").format(
                px=away
            )
    return ""
