"""A closed sensor's calibration as a table of normals by colour and place, for other programs."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.reconstruction.height_map import normals_from_slopes
from gelpolight_core.sensor.closed_sensor.colour_change import OFFSET
from gelpolight_core.sensor.closed_sensor.polynomial_terms import design_rows, position_axes
from gelpolight_core.sensor.closed_sensor.slope_model import (
    COLOUR_CELLS,
    COLOUR_RANGE,
    InPlaceModel,
    colour_cells,
)

COLOURS, PLACES = 15, 13
"""Entries along a channel and along the longer side of the image: slopes are polynomials of degree
3, which linear interpolation between so many changes by less than the error of the calibration."""


def write_normal_table(model: InPlaceModel, file: BinaryIO) -> None:
    """Write the normals that changes of colour mean at places of the image, as .npz.

    The arrays are: ``normal`` (rows, columns, red, green, blue, 3), x right, y down, z < 0 towards
    the camera; ``y_mm`` and ``x_mm``, its places; ``red``, ``green`` and ``blue``, its changes of
    colour; ``seen`` (red, green, blue), whether the balls of the calibration have shown such a
    change; ``background`` (nodes down, nodes across, 3), linear light of the untouched membrane;
    ``node_mm``, the distance of its nodes; ``smoothing_nodes`` and ``offset``. A change of colour
    is the light, smoothed by a Gaussian of this size, minus that of the background, over that of
    the background plus the offset.

    Parameters
    ----------
    model : InPlaceModel
        The calibrated model.
    file : binary file
        Where to write.
    """
    grid = model.grid
    rows, columns = _places(grid.shape)
    axes = _colour_axes(model.seen_colours)
    colours = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    cell = colour_cells(colours)
    x, y = position_axes(*grid.shape)
    normal = np.empty((rows.size, columns.size, len(colours), 3), np.float32)
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            at = np.full(len(colours), x[column]), np.full(len(colours), y[row])
            slopes = design_rows(colours, *at).astype(np.float64) @ model.coefficients
            # A dome has slopes at rest: the normals are those of what has changed.
            slopes -= grid.surface.slopes(np.array([grid.x_mm[column], grid.y_mm[row]]))
            normal[i, j] = normals_from_slopes(*slopes.T.astype(np.float32))
    shape = tuple(axis.size for axis in axes)
    np.savez_compressed(
        file,
        normal=normal.reshape(rows.size, columns.size, *shape, 3),
        y_mm=grid.y_mm[rows],
        x_mm=grid.x_mm[columns],
        red=axes[0],
        green=axes[1],
        blue=axes[2],
        seen=(model.seen_colours[cell[:, 0], cell[:, 1], cell[:, 2]] > 0.0).reshape(shape),
        background=model.background,
        node_mm=grid.pitch_mm,
        smoothing_nodes=model.smoothing_nodes,
        offset=OFFSET,
    )


def _places(shape: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns of the table, up to the border of the image."""
    step = (max(shape) - 1) / (PLACES - 1)
    down, across = (
        np.linspace(0, size - 1, max(round((size - 1) / step) + 1, 2)).round().astype(np.intp)
        for size in shape
    )
    return down, across


def _colour_axes(seen: Float32Array) -> list[Float32Array]:
    """Return the changes of each channel from the least to the largest that the balls showed."""
    low, high = COLOUR_RANGE
    width = (high - low) / COLOUR_CELLS
    axes = []
    for channel in range(3):
        others = tuple(k for k in range(3) if k != channel)
        at = np.flatnonzero(seen.max(axis=others))
        ends = low + width * at[0], low + width * (at[-1] + 1)
        axes.append(np.linspace(*ends, COLOURS, dtype=np.float32))
    return axes
