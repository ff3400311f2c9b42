"""Training data of the other methods: pixels of ball presses with their known slopes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.results import StageResults, need
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reflectance.press import BallPress, contact_mask
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
Predict = Callable[[Map, Map], Map]
"""From relative changes (N, 3) and positions in mm (N, 2) to slopes (N, 2)."""

FLAT_PIXELS = 4000
AWAY_MM = 4.0
LEAST_PIXELS = 200
DARK = 0.01
"""A background below this share of full scale has no ratio."""
_FIELDS = ("change", "position_mm", "slopes", "ball")
_KEYS = ("change", "place_mm", "slopes", "ball")  # of the npz files


@dataclass(frozen=True, slots=True)
class BallSamples:
    """Pixels of ball presses with their slopes.

    Attributes
    ----------
    change : (N, 3) float32
        I / I0 - 1: image over background, linear light as the camera sees it.
    position_mm : (N, 2) float32
        Position on the membrane.
    slopes : (N, 2) float32
        d(depth)/dx and d(depth)/dy; 0 beside the contact.
    ball : (N,) int16
        Number of the press.
    """

    change: Map
    position_mm: Map
    slopes: Map
    ball: NDArray[np.int16]

    def some(self, count: int, seed: int) -> BallSamples:
        """Return at most `count` of the pixels, chosen at random."""
        kept = np.random.default_rng(seed).permutation(len(self.ball))[:count]
        return BallSamples(
            self.change[kept], self.position_mm[kept], self.slopes[kept], self.ball[kept]
        )


def relative_change(light: Map, background: Map) -> Map:
    """Return I / I0 - 1 (..., 3) of linear light; 0 where the background is dark."""
    lit = background > DARK
    change = np.zeros_like(light)
    np.divide(light, background, out=change, where=lit)
    change[lit] -= 1.0
    return change


def ball_samples(results: StageResults) -> BallSamples:
    """Return the pixels of all ball presses of a calibration, inside and far outside the contact.

    Raises
    ------
    InputError
        If an earlier stage has no result, or the balls show too few pixels.
    """
    where = tr("balls")
    table, background = need(results.table, where), need(results.background, where)
    parts = [
        _samples_of(number, press, relative_change(image, background), table)
        for number, (press, image) in enumerate(zip(results.presses, results.images, strict=True))
    ]
    found = BallSamples(*(np.concatenate([getattr(p, name) for p in parts]) for name in _FIELDS))
    require_pixels(found)
    return found


def require_pixels(samples: BallSamples) -> None:
    """Refuse samples that are not sufficient for training.

    Raises
    ------
    InputError
        If too few of them have a slope.
    """
    count = int(np.count_nonzero(samples.slopes.any(axis=1)))
    if count < LEAST_PIXELS:
        raise InputError(
            tr("The balls show only {n} pixels").format(n=count),
            where=tr("balls"),
            advice=tr("Press more balls, and deeper"),
        )


def _samples_of(number: int, press: BallPress, change: Map, table: ResamplingTable) -> BallSamples:
    """Return the pixels of one press."""
    contact = np.nonzero(contact_mask(press, table) & table.valid)
    x, y = np.meshgrid(table.grid.x_mm, table.grid.y_mm)
    centre = press.pose.centre_mm
    far = np.hypot(x - centre[0], y - centre[1]) > press.contact_radius_mm + AWAY_MM
    beside = np.argwhere(far & table.valid)
    beside = np.random.default_rng(0).permutation(beside)[:FLAT_PIXELS]
    rows = np.concatenate([contact[0], beside[:, 0]])
    columns = np.concatenate([contact[1], beside[:, 1]])
    position = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
    slopes = np.zeros((rows.size, 2))
    inside = slice(0, contact[0].size)
    if contact[0].size:
        ray_slope = table.ray_slope[contact].mean(axis=0).astype(np.float64)
        away = position[inside] - press.seen_centre_mm(ray_slope)
        below = np.sqrt(np.maximum(press.pose.radius_mm**2 - (away**2).sum(axis=1), 1e-6))
        slopes[inside] = -away / below[:, None]
    return BallSamples(
        change[rows, columns],
        position.astype(np.float32),
        slopes.astype(np.float32),
        np.full(rows.size, number, np.int16),
    )


def write_samples(samples: BallSamples, path: Path) -> None:
    """Write samples as an npz file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    arrays = {key: getattr(samples, name) for key, name in zip(_KEYS, _FIELDS, strict=True)}
    write_atomically(path, lambda stream: np.savez(stream, **arrays))


def read_samples(path: Path) -> BallSamples:
    """Read samples that :func:`write_samples` wrote."""
    with np.load(path, allow_pickle=False) as arrays:
        return BallSamples(*(arrays[key] for key in _KEYS))
