"""What can have happened to a frame, each as a small linear model of the light of the membrane.

To add an explanation, write its effects and its entry in :func:`explanations`. All are fitted to
the same residual, by :mod:`.change_fit`; the texts are those of the faults.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .health_samples import BLUR, PARAMETERS, SHIFT_U, SHIFT_V, HealthSamples

MOST = 0.6
"""Largest change of the light, as a share, that a linear model still describes."""
PRESSED, MOVED = "all_pressed", "camera_moved"
GAINS, OFFSETS = np.arange(0, 6, 2), np.arange(1, 6, 2)
"""Parameters of :class:`HealthSamples` that are gains and room light of the channels."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """A change of a frame.

    Attributes
    ----------
    key : str
        Its name, that of its fault.
    effects : callable
        Returns the change of each cell's parameters (cells, PARAMETERS, p) by its own p parameters.
    sd : float
        Prior standard deviation of its parameters.
    most : float
        The largest size of a parameter with which it is tried: of shares of the light, the largest
        that a linear model still describes.
    least : float
        Above this, its first parameter must be: nothing pulls a membrane out.
    """

    key: str
    effects: Callable[[HealthSamples], Float64Array]
    sd: float
    most: float = MOST
    least: float = -np.inf

    def is_possible(self, values: Float64Array) -> bool:
        """Return whether parameters can be."""
        return bool(values[0] > self.least and np.abs(values).max() < self.most)


def _none(samples: HealthSamples, count: int) -> Float64Array:
    return np.zeros((samples.count.size, PARAMETERS, count))


def _gain(samples: HealthSamples) -> Float64Array:
    effects = _none(samples, 3)
    effects[:, GAINS, np.arange(3)] = 1.0
    return effects


def _room_light(samples: HealthSamples) -> Float64Array:
    effects = _none(samples, 3)
    effects[:, OFFSETS, np.arange(3)] = 1.0
    return effects


def _uneven(samples: HealthSamples) -> Float64Array:
    effects = _none(samples, samples.shapes.shape[1] - 1)
    if len(samples.shapes):
        effects[:, GAINS] = (samples.shapes - samples.shapes.mean(axis=0))[:, None, 1:]
    return effects


OTHERS = tuple((k, j) for k in range(3) for j in range(3) if j != k)
"""Channel and other channel, of which a share is added to the first."""


def _mixing(samples: HealthSamples) -> Float64Array:
    effects, light = _none(samples, len(OTHERS)), samples.cell_light
    for i, (k, j) in enumerate(OTHERS):
        effects[:, 2 * k, i] = light[:, j] / light[:, k]
    return effects


def _tone(samples: HealthSamples) -> Float64Array:
    """Return the effects of a power of the light, and of a parabola.

    A curve changes the texture within a cell by its slope: it acts as a gain and an offset, of
    which the light of the cell only shows the sum.
    """
    effects, light = _none(samples, 2), samples.cell_light
    effects[:, GAINS, 0], effects[:, OFFSETS, 0] = np.log(light) + 1.0, -light
    effects[:, GAINS, 1], effects[:, OFFSETS, 1] = 2.0 * light, -(light**2)
    return effects


def _moved(samples: HealthSamples) -> Float64Array:
    """Return the effects of a shift, px, and of a turn and a zoom about the middle of the image."""
    effects = _none(samples, 4)
    x, y = samples.shapes[:, 1], samples.shapes[:, 2]
    effects[:, SHIFT_U, 0], effects[:, SHIFT_V, 1] = 1.0, 1.0
    effects[:, SHIFT_U, 2], effects[:, SHIFT_V, 2] = -y, x
    effects[:, SHIFT_U, 3], effects[:, SHIFT_V, 3] = x, y
    return effects


def _blur(samples: HealthSamples) -> Float64Array:
    effects = _none(samples, 1)
    effects[:, BLUR, 0] = 1.0
    return effects


def explanations(press: Float64Array | None = None) -> tuple[Explanation, ...]:
    """Return all explanations, the most usual first. The gains are part of every fit.

    Parameters
    ----------
    press : (cells, 3, 6), optional
        Changes of the light by a press of the whole field, from
        :func:`~gelpolight_core.health.press_test.press_effects`, if the LEDs' places are known.
    """
    pressed = () if press is None else (_all_pressed(press),)
    return (
        Explanation("gain", _gain, 0.5),
        Explanation("room_light", _room_light, 0.05),
        Explanation(MOVED, _moved, 4.0, most=np.inf),
        Explanation("uneven", _uneven, 0.5),
        Explanation("blurred", _blur, 8.0, most=np.inf),
        *pressed,
        Explanation("colour_mixing", _mixing, 0.5),
        Explanation("tone", _tone, 0.5),
    )


def _all_pressed(press: Float64Array) -> Explanation:
    """Return the explanation that the whole field is pressed, by up to some millimetres."""

    def effects(samples: HealthSamples) -> Float64Array:
        effects = _none(samples, press.shape[2])
        effects[:, GAINS] = press
        return effects

    return Explanation(PRESSED, effects, 3.0, most=np.inf, least=0.0)
