"""The part of the grid that is solved for a frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.reconstruction.integration.poisson import good_length
from gelpolight_core.reconstruction.near_light.contact import Contact
from gelpolight_core.reconstruction.near_light.structures import Scale

LEAST_NODES = 8


@dataclass(frozen=True, slots=True)
class Region:
    """A rectangle of quarter-scale nodes: its first row and column, and its size."""

    corner: tuple[int, int]
    shape: tuple[int, int]

    def at(self, factor: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return corner and shape at a finer scale, `factor` nodes to a quarter-scale node."""
        (top, left), (rows, columns) = self.corner, self.shape
        return (factor * top, factor * left), (factor * rows, factor * columns)

    @property
    def nodes(self) -> int:
        """Quarter-scale nodes in it."""
        return self.shape[0] * self.shape[1]


def padded_region(contact: Contact, scale: Scale, margin_mm: float) -> Region:
    """Return a contact's region with a margin, its sides of lengths that the transform likes."""
    spans = []
    for axis in (1, 0):
        origin = (scale.x_mm, scale.y_mm)[axis]
        first = (contact.low[axis] - margin_mm - origin) / scale.pitch_mm
        last = (contact.high[axis] + margin_mm - origin) / scale.pitch_mm
        spans.append(_span(first, last, scale.kind.shape[1 - axis]))
    (top, rows), (left, columns) = spans
    return Region((top, left), (rows, columns))


def _span(first: float, last: float, length: int) -> tuple[int, int]:
    """Return begin and count of a span of nodes about `first` to `last`, of a good length."""
    begin, end = max(int(np.floor(first)), 0), min(int(np.ceil(last)) + 1, length)
    count = min(good_length(max(end - begin, LEAST_NODES)), length)
    return min(max((begin + end - count) // 2, 0), length - count), count
