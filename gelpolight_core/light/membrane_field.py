"""Directions to the camera, and the part of the membrane that the camera does not see."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.geometry.membrane_shape import MembraneShape


def view_directions(ray_slope: Float64Array) -> Float64Array:
    """Return unit directions (..., 3) back along the rays, from their slopes (..., 2)."""
    view = np.concatenate([ray_slope, -np.ones_like(ray_slope[..., :1])], axis=-1)
    return np.asarray(view / np.linalg.norm(view, axis=-1, keepdims=True))


class MembraneField(NamedTuple):
    """The membrane at rest out to its boundary, of which the camera sees a part.

    Parts of a curved membrane send light to each other, also those that are not in the image. A
    flat membrane has no other part than that in the image.

    Attributes
    ----------
    x_mm, y_mm : (columns,), (rows,)
        Nodes.
    room : 2 of (int, int)
        Rows, and columns, before and behind those that the camera sees.
    unseen : (rows, columns) float32
        Share of each node that is inside of the boundary, 0 where the camera sees.
    """

    x_mm: Float64Array
    y_mm: Float64Array
    room: tuple[tuple[int, int], tuple[int, int]]
    unseen: Float32Array

    @classmethod
    def around(
        cls, surface: MembraneShape, x_mm: Float64Array, y_mm: Float64Array
    ) -> MembraneField:
        """Return the field around the nodes that the camera sees."""
        axes, room = [], []
        for axis, centre in ((x_mm, surface.axis_mm[0]), (y_mm, surface.axis_mm[1])):
            pitch = axis[1] - axis[0] if axis.size > 1 else 1.0
            ends = np.array([axis[0] - centre, centre - axis[-1]]) + 0.5 * surface.diameter_mm
            before, behind = np.maximum(np.ceil(ends / pitch), 0).astype(int).tolist()
            if not surface.flat:
                # Whole multiples of 16 nodes: light is gathered from tiles of nodes.
                behind += -(before + axis.size + behind) % 16
            axes.append(axis[0] + pitch * np.arange(-before, axis.size + behind))
            room.append((before, behind))
        x, y = axes
        radius_mm = np.hypot(x - surface.axis_mm[0], (y - surface.axis_mm[1])[:, None])
        field = cls(
            x, y, (room[1], room[0]), (radius_mm < 0.5 * surface.diameter_mm).astype(np.float32)
        )
        field.unseen[field.seen] = 0.0
        return field

    @property
    def seen(self) -> tuple[slice, slice]:
        """Rows and columns that the camera sees."""
        (top, below), (left, right) = self.room
        return np.s_[top : self.y_mm.size - below, left : self.x_mm.size - right]

    def filled(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return visible values (rows, columns, ...) for the whole field, 0 elsewhere."""
        return np.pad(values, (*self.room, *((0, 0),) * (values.ndim - 2)))

    def continued(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return visible smooth values (rows, columns, ...), continued over the whole field."""
        room = (*self.room, *((0, 0),) * (values.ndim - 2))
        return np.pad(values, room, mode="reflect", reflect_type="odd")
