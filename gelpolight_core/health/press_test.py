"""Whether the whole field is pressed: a wide smooth surface changes the light of all cells.

A plate, a large ball, or a tilted face leaves nothing untouched to compare with. Its change of the
light follows from the LEDs' places: by the distance and direction of the light, and by the slope.
"""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .health_samples import HealthSamples


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
