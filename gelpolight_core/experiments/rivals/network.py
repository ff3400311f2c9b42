"""A small neural network from colour and position to slope, as the open tactile libraries train.

Three hidden layers of 128, 32 and 32 rectified units, trained on the angles of the slopes with
Adam (Kingma and Ba 2015). Plain NumPy: 6,000 parameters need no neural network library.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from gelpolight_core.experiments.rivals.samples import BallSamples, Map, require_pixels
from gelpolight_core.io.atomic import write_atomically

Layers = list[tuple[Map, Map]]
UNITS = (128, 32, 32)
MOST_SAMPLES = 200_000
STEPS, BATCH = 6000, 512
RATE, DECAYS, TINY = 1e-2, (0.9, 0.999), 1e-8
MOST_ANGLE = 1.4
BLOCK = 1 << 13
"""Pixels that are computed together, so that their values stay in the cache."""


@dataclass(frozen=True, slots=True)
class Network:
    """A trained network.

    Attributes
    ----------
    layers : list of (weights, bias)
        In their order.
    middle, spread : (5,) float32
        Scales of the inputs: colour changes, then position in mm.
    """

    layers: Layers
    middle: Map
    spread: Map

    def __call__(self, change: Map, position_mm: Map) -> Map:
        """Return the slopes (N, 2) of relative changes (N, 3) at positions (N, 2)."""
        slopes = np.empty((len(change), 2), np.float32)
        for begin in range(0, len(change), BLOCK):
            part = slice(begin, begin + BLOCK)
            given = np.concatenate([change[part], position_mm[part]], axis=1)
            angles = _values(self.layers, (given - self.middle) / self.spread)[-1]
            slopes[part] = np.tan(np.clip(angles, -MOST_ANGLE, MOST_ANGLE))
        return slopes

    def write(self, path: Path) -> None:
        """Write the network as an npz file."""
        arrays = [self.middle, self.spread, *(p for layer in self.layers for p in layer)]
        write_atomically(path, lambda stream: np.savez(stream, *arrays))


def read_network(path: Path) -> Network:
    """Read what :meth:`Network.write` wrote."""
    with np.load(path, allow_pickle=False) as stored:
        arrays = [stored[f"arr_{k}"] for k in range(len(stored.files))]
    return Network(list(zip(arrays[2::2], arrays[3::2], strict=True)), arrays[0], arrays[1])


def fit_network(samples: BallSamples, *, seed: int = 0, steps: int = STEPS) -> Network:
    """Train the network on ball pixels.

    Parameters
    ----------
    samples : BallSamples
        Of all presses.
    seed : int, optional
        Of the first weights and of the order of the pixels.
    steps : int, optional
        Of the descent, with `BATCH` pixels each.

    Raises
    ------
    InputError
        If the balls show too few pixels.
    """
    require_pixels(samples)
    some = samples.some(MOST_SAMPLES, seed)
    inputs = np.concatenate([some.change, some.position_mm], axis=1)
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0) + np.float32(1e-9)
    layers = _trained((inputs - middle) / spread, np.arctan(some.slopes), seed, steps)
    return Network(layers, middle, spread)


def _trained(inputs: Map, angles: Map, seed: int, steps: int) -> Layers:
    """Return the layers after stochastic descent of the mean squared error."""
    rng = np.random.default_rng(seed)
    sizes = (inputs.shape[1], *UNITS, angles.shape[1])
    layers: Layers = [
        # He et al. 2015: keeps the variance constant from layer to layer.
        (
            (rng.standard_normal((a, b)) * np.sqrt(2.0 / a)).astype(np.float32),
            np.zeros(b, np.float32),
        )
        for a, b in pairwise(sizes)
    ]
    moments = [[np.zeros_like(p) for _ in (0, 1)] for layer in layers for p in layer]
    for step in range(1, steps + 1):
        part = rng.integers(0, len(inputs), BATCH)
        rate = 0.5 * RATE * (1.0 + np.cos(np.pi * step / steps))
        _descend(layers, _gradients(layers, inputs[part], angles[part]), moments, rate, step)
    return layers


def _values(layers: Layers, inputs: Map) -> list[Map]:
    """Return the inputs of every layer, and the result."""
    values = [inputs]
    for number, (weights, bias) in enumerate(layers):
        value = values[-1] @ weights + bias
        if number < len(layers) - 1:
            np.maximum(value, 0.0, out=value)
        values.append(value)
    return values


def _gradients(layers: Layers, inputs: Map, wanted: Map) -> list[Map]:
    """Return the derivatives of the mean squared error, layer by layer: weights, bias."""
    values = _values(layers, inputs)
    error = (values[-1] - wanted) * np.float32(2.0 / len(inputs))
    found: list[Map] = []
    for (weights, _), given in zip(reversed(layers), reversed(values[:-1]), strict=True):
        found = [given.T @ error, error.sum(axis=0), *found]
        error = (error @ weights.T) * (given > 0.0)
    return found


def _descend(
    layers: Layers,
    gradients: Sequence[Map],
    moments: Sequence[Sequence[Map]],
    rate: float,
    step: int,
) -> None:
    """Do one step of Adam in place."""
    parameters = [p for layer in layers for p in layer]
    for parameter, gradient, (mean, square) in zip(parameters, gradients, moments, strict=True):
        mean += np.float32(1.0 - DECAYS[0]) * (gradient - mean)
        square += np.float32(1.0 - DECAYS[1]) * (gradient**2 - square)
        even_mean = mean / (1.0 - DECAYS[0] ** step)
        even_square = square / (1.0 - DECAYS[1] ** step)
        parameter -= (rate * even_mean / (np.sqrt(even_square) + TINY)).astype(np.float32)
