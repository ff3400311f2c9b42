"""Faults of the virtual bench that change the image: light, lens and dirt."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from app.sources.bench import BOARDS
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.exposure import blurred

Array = NDArray[np.floating]

ROOM_LIGHT = (0.066, 0.060, 0.050)
"""Light of a lit room in the three channels at the nominal exposure; 1 is full scale."""
TOO_BRIGHT = 3.0
"""Factor on the light of an overexposed image."""
DEFOCUS_OF_WIDTH = 0.012
"""Blur of a defocused lens (standard deviation) as a share of the image's width."""
DEAD_LED = 2
"""The LED that is switched off: the blue one."""
SPECKS, SPECK_OF_WIDTH, SPECK_LIGHT = 40, 0.004, 0.35
"""Number of dust specks, their mean radius as a share of the width, and the light that passes."""


def with_faults(
    signal: Array, faults: frozenset[str], *, item: str, design: SensorDesign, seed: int
) -> Array:
    """Return a noise-free image with the faults that are switched on.

    Parameters
    ----------
    signal : (rows, columns) or (rows, columns, 3)
        Linear light at the nominal exposure; grey for boards.
    faults : frozenset of str
        Names of :data:`~app.sources.bench.FAULTS`.
    item : str
        The object on the sensor; the LEDs and the room do not light a board.
    design : SensorDesign
        Gives the crosstalk of the channels.
    seed : int
        Of the positions of the dust.
    """
    if item not in BOARDS:
        if "led_off" in faults:
            signal = _without_led(signal, np.array(design.photometry.crosstalk))
        if "room_light" in faults:
            signal = signal + np.array(ROOM_LIGHT)
    if "dust" in faults:
        clear = _dust(signal.shape[:2], seed)
        signal = signal * (clear if signal.ndim == 2 else clear[..., None])
    if "defocused" in faults:
        signal = blurred(signal, DEFOCUS_OF_WIDTH * signal.shape[1])
    return signal * TOO_BRIGHT if "too_bright" in faults else signal


def _without_led(signal: Array, crosstalk: Array) -> Array:
    """Return an image (..., 3) without the light of one LED, in all channels that see it."""
    kept = np.eye(3)
    kept[DEAD_LED, DEAD_LED] = 0.0
    return np.asarray(signal @ (crosstalk @ kept @ np.linalg.inv(crosstalk)).T)


def _dust(shape: tuple[int, ...], seed: int) -> Array:
    """Return the share of light (rows, columns) that passes the dust."""
    random, (rows, columns) = np.random.default_rng(seed), shape
    clear = np.ones((rows, columns))
    radius = SPECK_OF_WIDTH * columns
    for x, y, size in random.uniform((0, 0, 0.5), (columns, rows, 1.5), (SPECKS, 3)):
        centre, wide = (round(x), round(y)), max(round(size * radius), 1)
        cv2.circle(clear, centre, wide, SPECK_LIGHT, cv2.FILLED)
    return clear
