"""The calibrated model of a closed sensor, and the slopes that it gives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.compiling import whole
from gelpolight_core.base.row_threads import RowThreadPool

from .colour_change import (
    SMOOTHING_NODES,
    ColourChange,
    ReferenceImage,
    colour_change,
    make_reference_image,
)
from .polynomial_terms import POWERS, evaluate_rows, position_axes, row_coefficients
from .working_grid import WorkingGrid

COLOUR_CELLS = 32
"""Cells along each channel of the table of colours that the balls have shown."""
COLOUR_RANGE = (-1.0, 3.0)


@dataclass(frozen=True, slots=True)
class ErrorCurve:
    """Errors of slopes and depths of presses that were left out.

    Attributes
    ----------
    slopes : (nodes,)
        Size of the slope, rising from 0.
    slope_sd : (nodes,)
        Root mean square error of a slope's component there.
    depth_share : float
        Relative error of a press's height, root mean square.
    depth_floor_mm : float
        Root mean square of the depth where nothing touches.
    """

    slopes: Float64Array
    slope_sd: Float64Array
    depth_share: float
    depth_floor_mm: float


@dataclass(frozen=True)
class InPlaceModel:
    """The membrane of a closed sensor: background, and slope from change of colour and position.

    Attributes
    ----------
    grid : WorkingGrid
        Nodes and scale.
    background : (rows, columns, 3) float32
        Linear light of the untouched membrane on the grid.
    coefficients : (terms, 2)
        Coefficients of the polynomials to d(depth)/dx and d(depth)/dy.
    seen_colours : (cells, cells, cells) float32
        1 where the balls have shown such a change of colour, else 0.
    steepest : float
        Largest slope that the balls have shown.
    errors : ErrorCurve
        Errors of presses that were left out.
    follow_gain : bool
        Whether the strength of the light was corrected in the images of the balls: not in some
        files of older programs. Part of the identity.
    scale_sd : float
        Relative standard deviation of `grid.mm_per_px`.
    press_light : (presses, KINDS) float64 or None
        Changes of the light in the images of the balls, as
        :func:`~gelpolight_core.health.press_scatter.changes_of` gives them; None in files of older
        programs.
    smoothing_nodes : float
        Standard deviation of the smoothing of images.
    """

    grid: WorkingGrid
    background: Float32Array
    coefficients: Float64Array
    seen_colours: Float32Array
    steepest: float
    errors: ErrorCurve
    follow_gain: bool = True
    scale_sd: float = 0.0
    press_light: Float64Array | None = None
    smoothing_nodes: float = SMOOTHING_NODES

    @cached_property
    def reference(self) -> ReferenceImage:
        """The background, smoothed."""
        return make_reference_image(self.background, self.smoothing_nodes)

    def change(self, rgb: Float32Array, gain: Float64Array | None = None) -> ColourChange:
        """Return the change of colour in a camera image (height, width, 3)."""
        return colour_change(self.grid.reduce(rgb), self.reference, gain)

    def slopes(
        self, change: Float32Array, workers: RowThreadPool | None = None
    ) -> tuple[Float32Array, Float32Array]:
        """Return d(depth)/dx and d(depth)/dy (rows, columns) of a change of colour."""
        return evaluate_slopes(self.coefficients, change, workers, rows=self._rows)

    @cached_property
    def _rows(self) -> Float32Array:
        return row_coefficients(self.coefficients, position_axes(*self.grid.shape)[1])

    def extrapolated(
        self, change: Float32Array, slope_x: Float32Array, slope_y: Float32Array
    ) -> BoolArray:
        """Return where slope or colour is beyond what the balls have shown."""
        mask = np.empty(slope_x.shape, np.bool_)
        # Slopes up to a tenth above the steepest one of the balls are not extrapolated.
        steepest = np.float32((1.1 * self.steepest) ** 2)
        scale = np.float32(COLOUR_CELLS / (COLOUR_RANGE[1] - COLOUR_RANGE[0]))
        low = np.float32(COLOUR_RANGE[0])
        _beyond(change, slope_x, slope_y, self.seen_colours, low, scale, steepest, mask)
        return mask


def evaluate_slopes(
    coefficients: Float64Array,
    change: Float32Array,
    workers: RowThreadPool | None = None,
    *,
    rows: Float32Array | None = None,
) -> tuple[Float32Array, Float32Array]:
    """Return the slopes (rows, columns) that a polynomial gives.

    Parameters
    ----------
    coefficients : (terms, 2)
        Coefficients of the polynomials.
    change : (rows, columns, 3) float32
        Change of colour.
    workers : RowThreadPool, optional
        Threads; by default one.
    rows : array, optional
        The polynomial of each row, where it is known already.
    """
    x, y = position_axes(*change.shape[:2])
    rows = row_coefficients(coefficients, y) if rows is None else rows
    slope_x = np.empty(change.shape[:2], np.float32)
    slope_y = np.empty_like(slope_x)
    whole = np.ascontiguousarray(change, np.float32)
    arguments = (whole, x, rows, POWERS, slope_x, slope_y)
    if workers is None:
        evaluate_rows(0, len(whole), *arguments)
    else:
        workers.run(len(whole), evaluate_rows, *arguments)
    return slope_x, slope_y


def colour_cells(change: Float32Array) -> NDArray[np.int32]:
    """Return the cell (..., 3) of a change of colour."""
    low, high = COLOUR_RANGE
    cell = (change - np.float32(low)) * np.float32(COLOUR_CELLS / (high - low))
    np.clip(cell, 0, COLOUR_CELLS - 1, out=cell)
    return np.asarray(cell, np.int32)


@whole()
def _cell(value, low, scale, last):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    position = (value - low) * scale
    if not position > np.float32(0.0):  # also values that are not numbers
        return 0
    return min(int(min(position, np.float32(last))), last)


@whole()
def _beyond(change, slope_x, slope_y, seen, low, scale, steepest, found):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write where a slope's square is above `steepest`, or the cell of the colour is not `seen`."""
    rows, columns = slope_x.shape
    last = seen.shape[0] - 1
    for i in range(rows):
        for j in range(columns):
            r = _cell(change[i, j, 0], low, scale, last)
            g = _cell(change[i, j, 1], low, scale, last)
            b = _cell(change[i, j, 2], low, scale, last)
            x, y = slope_x[i, j], slope_y[i, j]
            is_seen = seen[r, g, b] > 0.0
            found[i, j] = x * x + y * y > steepest or not is_seen
