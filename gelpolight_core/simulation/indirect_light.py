"""Light from other parts of the membrane, as a map over the working circle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.arrays import Array
from gelpolight_core.simulation.occlusion import sample_all
from gelpolight_core.simulation.rays import RayTable


@dataclass(frozen=True, slots=True)
class IndirectLight:
    """Brightness towards the camera due to light from other parts of the surface.

    Attributes
    ----------
    maps : (lamps, rows, columns)
        For a reflectance factor of 1; empty without interreflection.
    first_mm, pitch_mm : float
        Position of the first cell in x and y, and the cell size.
    """

    maps: Array
    first_mm: float
    pitch_mm: float

    @property
    def values(self) -> tuple[Array, float, float]:
        """The light in the format of the compiled code."""
        return self.maps, self.first_mm, self.pitch_mm

    def add_flat(self, light: Array, rays: RayTable) -> None:
        """Add what each pixel sees of it on the flat surface to (rows, columns, lamps), in place.

        Parameters
        ----------
        light : (rows, columns, lamps)
            Brightness without losses.
        rays : RayTable
            Rays of the pixels.
        """
        column = np.asarray((rays.x_mm - self.first_mm) / self.pitch_mm)
        row = np.asarray((rays.y_mm - self.first_mm) / self.pitch_mm)
        for k, values in enumerate(self.maps):
            light[..., k] += sample_all(values, column, row)


NO_LIGHT = IndirectLight(np.zeros((0, 1, 1)), 0.0, 1.0)
