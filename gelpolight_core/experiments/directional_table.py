"""The common method for comparison: one table from colour to slope, n = F(I) (the paper's Eq. 2).

Light is taken as parallel and even, so that the same colour means the same slope everywhere. The
table is filled from ball presses: each pixel of a contact has a colour and the ball's slope there.
As usual, the colour is what the press changes: picture less background. Colours that no ball has
shown take the nearest that one has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from gelpolight_core.errors import InputError
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.reconstruction.full import as_linear
from gelpolight_core.reconstruction.poisson import PoissonSolver
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
BINS = 48
LEAST_PIXELS = 200
SPREAD = 99.8


@dataclass(frozen=True, slots=True)
class BallSamples:
    """Pixels of a ball press with their known slopes.

    Attributes
    ----------
    change : (N, 3) float32
        Picture less background, linear light.
    slopes : (N, 2) float32
        d(depth)/dx and d(depth)/dy.
    """

    change: Map
    slopes: Map


@dataclass(frozen=True, slots=True)
class DirectionalTable:
    """A table from colour to slope, ready for frames.

    Attributes
    ----------
    slopes : (BINS, BINS, BINS, 2) float32
        Mean slope of each colour.
    low, step : (3,) float32
        Least change of each channel, and the width of its bins.
    background : (rows, columns, 3) float32
        The untouched membrane on the grid, linear light.
    table : ResamplingTable
        From raw pixel to membrane.
    solver : PoissonSolver
        From slopes to depth.
    """

    slopes: Map
    low: Map
    step: Map
    background: Map
    table: ResamplingTable
    solver: PoissonSolver

    def slopes_of(self, frame: NDArray[np.generic]) -> tuple[Map, Map]:
        """Return d(depth)/dx and d(depth)/dy (rows, columns) of a raw frame."""
        change = self.table.apply(as_linear(frame)) - self.background
        place = ((change - self.low) / self.step).astype(np.int32)
        np.clip(place, 0, BINS - 1, out=place)
        found = self.slopes[place[..., 0], place[..., 1], place[..., 2]]
        found[~self.table.valid] = 0.0
        return np.ascontiguousarray(found[..., 0]), np.ascontiguousarray(found[..., 1])

    def depth(self, frame: NDArray[np.generic]) -> tuple[Map, Map, Map]:
        """Return depth and both slopes (rows, columns) of a raw frame (height, width, 3)."""
        slope_x, slope_y = self.slopes_of(frame)
        depth = self.solver.integrate(slope_x, slope_y).depth_mm
        return np.asarray(depth, np.float32), slope_x, slope_y


def fit_directional_table(
    balls: Sequence[BallSamples],
    background: Map,
    table: ResamplingTable,
    *,
    flat: Map,
    workers: int = 2,
) -> DirectionalTable:
    """Fill the table from ball presses.

    Parameters
    ----------
    balls : sequence of BallSamples
        Of all presses.
    background : (rows, columns, 3) float32
        The untouched membrane on the grid.
    table : ResamplingTable
        From raw pixel to membrane.
    flat : (N, 3) float32
        Changes of pixels that nothing touches: what noise makes of flat membrane.
    workers : int, optional
        Threads of the transforms.

    Raises
    ------
    InputError
        If the balls show too few pixels.
    """
    change = np.concatenate([*(b.change for b in balls), flat])
    slopes = np.concatenate([*(b.slopes for b in balls), np.zeros((len(flat), 2), np.float32)])
    if len(change) - len(flat) < LEAST_PIXELS:
        raise InputError(
            tr("the balls show only {n} pixels").format(n=len(change) - len(flat)),
            where=tr("balls"),
            advice=tr("Press more balls, and deeper"),
        )
    low, high = np.percentile(change, [100.0 - SPREAD, SPREAD], axis=0)
    step = np.maximum((high - low) / BINS, 1e-6)
    place = np.clip(((change - low) / step).astype(int), 0, BINS - 1)
    flat_place = np.ravel_multi_index((place[:, 0], place[:, 1], place[:, 2]), (BINS,) * 3)
    count = np.bincount(flat_place, minlength=BINS**3).reshape((BINS,) * 3)
    sums = [np.bincount(flat_place, slopes[:, k], BINS**3).reshape(count.shape) for k in (0, 1)]
    mean = np.stack([total / np.maximum(count, 1) for total in sums], axis=-1)
    nearest = distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    filled = mean[tuple(nearest)]
    grid = table.grid
    return DirectionalTable(
        filled.astype(np.float32),
        low.astype(np.float32),
        step.astype(np.float32),
        background,
        table,
        PoissonSolver(*grid.shape, pitch_mm=grid.pitch_mm, workers=workers),
    )
