"""The result for one image of a ball press, and its light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gelpolight_core.base.arrays import Float32Array
    from gelpolight_core.base.errors import InputError
    from gelpolight_core.health.frame_health import LightGain
    from gelpolight_core.stages.balls.ball_press import BallPress


@dataclass(frozen=True, slots=True)
class PressLight:
    """The light of a ball press against that of the background.

    Attributes
    ----------
    gain : LightGain or None
        Its change, which is corrected; None if the light has not changed within its noise, or if
        the change cannot be corrected.
    largest : float
        Largest change that is corrected, as a share.
    corrected, uncorrected : tuple of str
        Keys of the changes that are corrected, and of those that remain.
    """

    gain: LightGain | None = None
    largest: float = 0.0
    corrected: tuple[str, ...] = ()
    uncorrected: tuple[str, ...] = ()


UNCHANGED = PressLight()
WHAT_CHANGED = {
    "led_off": "The light of one LED",
    "room_light": "Room light",
    "uneven": "The distribution of the light",
    "rows": "The light from row to row (mains or LEDs that flicker, exposure in mid frame)",
    "colour_mixing": "The camera's mixing of colours",
}
"""Changes of the light, by their keys."""


def what_changed(keys: Sequence[str]) -> str:
    """Return what changed most often, for a message, from the keys of changes."""
    usual = max(keys, key=keys.count, default="")
    return WHAT_CHANGED.get(usual, "Exposure, LEDs or room light")


@dataclass(frozen=True, slots=True)
class BallImageResult:
    """The result for one image of a ball press.

    Attributes
    ----------
    file : str
        Its name in ``balls``.
    key : str
        Changes with any input of the result.
    image : (rows, columns, 3) float32 or None
        Resampled onto the grid, in the light of the background; None if no ball was found.
    press : BallPress or None
        The ball; None if none was found.
    fault : InputError or None
        Why no ball was found.
    light : PressLight
        Change of its light.
    cells : (rows, columns, 3) float32 or None
        Light of the untouched part after the correction; None if the image cannot be used.
    """

    file: str
    key: str
    image: Float32Array | None = None
    press: BallPress | None = None
    fault: InputError | None = None
    light: PressLight = UNCHANGED
    cells: Float32Array | None = None
