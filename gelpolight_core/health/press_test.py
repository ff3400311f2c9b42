"""Whether the whole field is pressed: a wide smooth surface changes the light of all cells.

A plate, a large ball, or a tilted face leaves nothing untouched to compare with. Its change of the
light follows from the LEDs' places: by the distance and direction of the light, and by the slope.
"""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array

from .global_change import CORRELATED, SIGMAS
from .health_samples import HealthSamples

ROUNDS = 8


def press_effects(
    samples: HealthSamples, leds_mm: Float64Array, unmix: Float64Array
) -> Float64Array:
    """Return the change of each cell's light (cells, 3, 6) by depths of smooth shapes, per mm.

    Parameters
    ----------
    samples : HealthSamples
        Samples of the background.
    leds_mm : (3, 3)
        Positions of the LEDs, which radiate towards the membrane, sensor frame.
    unmix : (3, 3)
        Light of each LED from that of the channels.
    """
    x, y = samples.place_mm.T
    reach = float(np.abs(samples.place_mm).max(initial=1.0))
    x, y, none, one = x / reach, y / reach, np.zeros_like(x), np.ones_like(x)
    shapes = np.stack([one, x, y, x * x, x * y, y * y], axis=-1)
    along_x = np.stack([none, one, none, 2.0 * x, y, none], axis=-1) / reach
    along_y = np.stack([none, none, one, none, x, 2.0 * y], axis=-1) / reach
    effects = np.empty((x.size, 3, 6))
    for k, (led_x, led_y, led_z) in enumerate(leds_mm):
        across_x, across_y, height = led_x - reach * x, led_y - reach * y, -led_z
        square = across_x**2 + across_y**2 + height**2
        nearer = 4.0 * height / square - 2.0 / height
        effects[:, k] = nearer[:, None] * shapes
        effects[:, k] -= (across_x[:, None] * along_x + across_y[:, None] * along_y) / height
    background = samples.cell_light
    of_led = background @ unmix.T
    mixed = np.einsum("kj,cj,cji->cki", np.linalg.inv(unmix), of_led, effects)
    return np.asarray(mixed / background[..., None])


def is_pressed(
    samples: HealthSamples,
    effects: Float64Array,
    change: Float64Array,
    usable: BoolArray,
    left: Float64Array,
) -> bool:
    """Return whether a press of the whole field explains a frame better than a change of light.

    Parameters
    ----------
    samples : HealthSamples
        Samples of the background.
    effects : (cells, 3, 6)
        From :func:`press_effects`.
    change : (cells, 3)
        Change of each cell's light, as a share.
    usable : (cells,) bool
        Cells that are not saturated.
    left : (cells, 3)
        What the change of light leaves of it.
    """
    if not usable.any():
        return False
    sd = CORRELATED / np.sqrt(samples.by_gain)
    measured, press = change / sd, effects / sd[..., None]
    weight, remaining = usable.astype(np.float64), measured
    for _ in range(ROUNDS):
        weighted = weight[:, None, None] * press
        matrix = np.tensordot(weighted, press, ((0, 1), (0, 1)))
        # Too few cells with light do not determine all parts of a press.
        depth_mm = np.linalg.pinv(matrix) @ np.tensordot(weighted, measured, ((0, 1), (0, 1)))
        remaining = measured - press @ depth_mm
        size = np.abs(remaining).max(axis=1)
        reach = SIGMAS * max(float(np.median(size[usable])), 1.0)
        weight = usable * np.maximum(1.0 - (size / reach) ** 2, 0.0) ** 2
    by_light, by_press = (
        np.minimum(part[usable] ** 2, SIGMAS**2).sum() for part in (left / sd, remaining)
    )
    # Nothing pulls the membrane out.
    explained = float(np.median(np.abs(remaining[usable]).max(axis=1))) < SIGMAS
    return bool(explained and by_press < by_light and depth_mm[0] > 0.0)
