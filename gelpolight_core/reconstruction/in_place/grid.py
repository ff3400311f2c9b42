"""Positions of the pixels of a closed sensor on its membrane.

Lens and layers are unknown. A position is the distance of the pixel from the image centre times the
scale, x right, y down. Large images are averaged over blocks of pixels, because the texture of the
gel limits the resolution more than the camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.optics.resampling import MembraneGrid, ResamplingTable
from gelpolight_core.reflectance.contour import Circle

Map = NDArray[np.float32]
WORKING_SIDE = 320
"""Approximate number of nodes along the longer side of the grid."""


@dataclass(frozen=True, slots=True)
class ImageSize:
    """Size of the camera's images in pixels."""

    width: int
    height: int


@dataclass(frozen=True, slots=True)
class WorkingGrid:
    """The regular grid on which a closed sensor is calibrated and reconstructed.

    Attributes
    ----------
    image : ImageSize
        Of the camera.
    mm_per_px : float
        Size of a camera pixel on the membrane.
    """

    image: ImageSize
    mm_per_px: float

    @property
    def factor(self) -> int:
        """Camera pixels along a side of one node's block."""
        return max(1, round(max(self.image.width, self.image.height) / WORKING_SIDE))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the grid."""
        return self.image.height // self.factor, self.image.width // self.factor

    @property
    def pitch_mm(self) -> float:
        """Distance between neighbouring nodes."""
        return self.factor * self.mm_per_px

    @property
    def x_mm(self) -> NDArray[np.float64]:
        """Places of the columns."""
        return self._positions(self.shape[1], self.image.width)

    @property
    def y_mm(self) -> NDArray[np.float64]:
        """Places of the rows."""
        return self._positions(self.shape[0], self.image.height)

    def _positions(self, count: int, pixels: int) -> NDArray[np.float64]:
        index = self.factor * np.arange(count) + 0.5 * (self.factor - 1)
        return np.asarray((index - 0.5 * (pixels - 1)) * self.mm_per_px)

    def reduce(self, rgb: Map) -> Map:
        """Return an image (height, width, 3) averaged over each node's block."""
        if self.factor == 1:
            return rgb
        rows, columns = (n * self.factor for n in self.shape)
        size = self.shape[::-1]
        whole = np.ascontiguousarray(rgb[:rows, :columns])
        return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.float32)

    def to_pixels(self, points_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the camera pixels (N, 2) at positions (N, 2) on the membrane."""
        middle = 0.5 * (np.array([self.image.width, self.image.height]) - 1.0)
        return np.asarray(points_mm / self.mm_per_px + middle, np.float64)

    def on_nodes(self, circle: Circle) -> Circle:
        """Return a circle in camera pixels as one in nodes."""
        shift = 0.5 * (self.factor - 1)
        x, y = ((centre - shift) / self.factor for centre in (circle.x, circle.y))
        return Circle(x, y, circle.radius / self.factor)

    def table(self) -> ResamplingTable:
        """Return the camera pixel of each node; rays are assumed to be vertical."""
        grid = MembraneGrid(self.x_mm, self.y_mm, self.pitch_mm)
        columns, rows = (
            np.asarray(mm / self.mm_per_px + 0.5 * (n - 1), np.float32)
            for mm, n in ((self.x_mm, self.image.width), (self.y_mm, self.image.height))
        )
        u, v = (np.ascontiguousarray(a) for a in np.meshgrid(columns, rows))
        ray_slope = np.zeros((*self.shape, 2), np.float32)
        return ResamplingTable(grid, u, v, np.ones(self.shape, np.bool_), ray_slope)
