"""From the slopes of a closed sensor's surface to its colours: the polynomial solved backwards.

Two slopes determine two of the three directions in which a colour can change. In the third one the
calibration determines nothing; the least change is taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gelpolight_core.arrays import Map
from gelpolight_core.reconstruction.in_place.change import LARGEST_CHANGE
from gelpolight_core.reconstruction.in_place.model import InPlaceModel

PARTS = 4
"""Newton steps from the flat membrane to the slopes: with 8, images of balls differ by 1e-4."""
NEXT = np.float32(0.01)
"""Change of colour over which the derivative is taken."""


class Inverse(NamedTuple):
    """The colours of a surface.

    Attributes
    ----------
    change : (rows, columns, 3) float32
        Change of colour.
    by_colour : (3, 2, rows, columns) float32
        Derivative there of both slopes by each channel.
    slope_variance : float
        Of the errors of slopes, which limit how large a change is worth a better fit.
    """

    change: Map
    by_colour: Map
    slope_variance: float

    def least(self, slopes: Map) -> Map:
        """Return the least change (rows, columns, 3) that gives further slopes (2, ...)."""
        by_x, by_y = self.by_colour[:, 0], self.by_colour[:, 1]
        xx, yy = ((by**2).sum(axis=0) + self.slope_variance for by in (by_x, by_y))
        xy = (by_x * by_y).sum(axis=0)
        along_x = (yy * slopes[0] - xy * slopes[1]) / (xx * yy - xy * xy)
        along_y = (xx * slopes[1] - xy * slopes[0]) / (xx * yy - xy * xy)
        return np.moveaxis(by_x * along_x + by_y * along_y, 0, -1)

    def in_known_directions(self, change: Map) -> Map:
        """Return the part of a change (rows, columns, 3) that changes the slopes."""
        return self.least(np.einsum("ksij,ijk->sij", self.by_colour, change))


def inverse(model: InPlaceModel, slope_x: Map, slope_y: Map) -> Inverse:
    """Return the colours of a surface with slopes (rows, columns)."""
    slopes = np.stack([slope_x, slope_y])
    change = np.zeros((*slope_x.shape, 3), np.float32)
    variance = float(model.errors.slope_sd.min()) ** 2
    for part in range(1, PARTS + 1):
        now, by_colour = _derivative(model, change)
        step = Inverse(change, by_colour, variance).least(slopes * (part / PARTS) - now)
        change = np.clip(change + step, -1.0, LARGEST_CHANGE).astype(np.float32)
    return Inverse(change, _derivative(model, change)[1], variance)


def _derivative(model: InPlaceModel, change: Map) -> tuple[Map, Map]:
    """Return the slopes (2, rows, columns) of a change of colour, and their derivative."""
    now = np.stack(model.slopes(change))
    moved = (np.stack(model.slopes(change + NEXT * axis)) for axis in np.eye(3, dtype=np.float32))
    return now, np.stack([(slopes - now) / NEXT for slopes in moved])
