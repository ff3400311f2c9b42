"""Positions of the pixels of a closed sensor on its membrane.

Lens and layers are unknown. A position is the distance of the pixel from the image centre times the
scale, x right, y down. Large images are averaged over blocks of pixels, because the texture of the
gel limits the resolution more than the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.optics.resampling import LEAST_NODES, MembraneGrid, ResamplingTable
from gelpolight_core.reflectance.contour import Circle
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
Map = NDArray[np.float32]
WORKING_SIDE = 320
"""Approximate number of nodes along the longer side of the grid."""


@dataclass(frozen=True, slots=True)
class ImageSize:
    """Size of the camera's images in pixels."""

    width: int
    height: int


@dataclass(frozen=True, slots=True, repr=False)
class WorkingGrid:
    """The regular grid on which a closed sensor is calibrated and reconstructed.

    Attributes
    ----------
    image : ImageSize
        Of the camera.
    mm_per_px : float
        Size of a camera pixel on the membrane along x.
    aspect : float
        Size of a camera pixel along y over its size along x.
    region_px : (x, y, width, height) or None
        The membrane's part of the image; None for all of it.
    """

    image: ImageSize
    mm_per_px: float
    aspect: float = 1.0
    region_px: tuple[int, int, int, int] | None = None

    def __post_init__(self) -> None:
        """Refuse a region that is not inside the image or cannot hold a press.

        Raises
        ------
        InputError
            If `region_px` is such a region.
        """
        x, y, width, height = self.region
        ends = self.image.width - x - width, self.image.height - y - height
        if self.region_px and (min(x, y, *ends) < 0 or min(self.shape) < LEAST_NODES):
            raise InputError(
                tr(
                    "The region {region} is not inside the image of {w} x {h} pixels or below {n}"
                ).format(
                    region=list(self.region), w=self.image.width, h=self.image.height, n=LEAST_NODES
                ),
                "region_px",
                Remedy.STATE_IN_SESSION,
            )

    def __repr__(self) -> str:
        """Return the fields that are not as usual: part of the identity of a calibration."""
        values = ((f.name, getattr(self, f.name), f.default) for f in fields(self))
        text = ", ".join(f"{name}={value!r}" for name, value, usual in values if value != usual)
        return f"WorkingGrid({text})"

    @property
    def region(self) -> tuple[int, int, int, int]:
        """(x, y, width, height) of the membrane's part of the image."""
        return self.region_px or (0, 0, self.image.width, self.image.height)

    @property
    def factor(self) -> int:
        """Camera pixels along x in one node's block."""
        return max(1, round(max(self.region[2], self.region[3] * self.aspect) / WORKING_SIDE))

    @property
    def step_px(self) -> Array:
        """Camera pixels (2,) along x and y between neighbouring nodes."""
        return np.array([self.factor, self.factor / self.aspect])

    @property
    def pixel_mm(self) -> Array:
        """Size of a camera pixel on the membrane (2,) along x and y."""
        return np.array([self.mm_per_px, self.mm_per_px * self.aspect])

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the grid."""
        # Rounded first, because the ratio of two stated scales is not exact.
        columns, rows = np.round(np.array(self.region[2:]) / self.step_px, 6).astype(int)
        return int(rows), int(columns)

    @property
    def pitch_mm(self) -> float:
        """Distance between neighbouring nodes."""
        return self.factor * self.mm_per_px

    @property
    def x_mm(self) -> Array:
        """Places of the columns."""
        return self._positions(0)

    @property
    def y_mm(self) -> Array:
        """Places of the rows."""
        return self._positions(1)

    def _pixels(self, axis: int) -> Array:
        pixels = self.step_px[axis] * np.arange(self.shape[1 - axis]) + self._first_px[axis]
        return np.asarray(pixels)

    def _positions(self, axis: int) -> Array:
        return np.asarray((self._pixels(axis) - self._middle_px[axis]) * self.pixel_mm[axis])

    @property
    def _first_px(self) -> Array:
        return np.array(self.region[:2]) + 0.5 * (self.step_px - 1.0)

    @property
    def _middle_px(self) -> Array:
        return np.asarray(0.5 * (np.array([self.image.width, self.image.height]) - 1.0))

    def cut(self, rgb: Map) -> Map:
        """Return the membrane's part of an image (height, width, 3)."""
        x, y, width, height = self.region
        return rgb[y : y + height, x : x + width]

    def reduce(self, rgb: Map) -> Map:
        """Return an image (height, width, 3) averaged over each node's block."""
        rows, columns = self.shape
        # Whole pixels are averaged; what is left of the step along y is interpolated.
        tall = max(1, int(self.step_px[1]))
        left = self.step_px[1] / tall
        part = self.cut(rgb)
        if self.factor > 1 or tall > 1:
            size = columns, len(part) // tall
            whole = np.ascontiguousarray(part[: size[1] * tall, : columns * self.factor])
            part = np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.float32)
        if left == 1.0:
            return part
        x, y = np.arange(columns), left * np.arange(rows) + 0.5 * (left - 1.0)
        u, v = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
        return np.asarray(cv2.remap(part, u, v, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE))

    def to_pixels(self, points_mm: NDArray[np.floating]) -> Array:
        """Return the camera pixels (N, 2) at positions (N, 2) on the membrane."""
        return np.asarray(points_mm / self.pixel_mm + self._middle_px, np.float64)

    def on_nodes(self, circle: Circle) -> Circle:
        """Return a circle in camera pixels as one in nodes."""
        x, y = (np.array([circle.x, circle.y]) - self._first_px) / self.step_px
        return Circle(float(x), float(y), circle.radius / self._mean_step_px)

    def in_image(self, circle: Circle) -> Circle:
        """Return a circle in nodes as one in camera pixels."""
        x, y = np.array([circle.x, circle.y]) * self.step_px + self._first_px
        return Circle(float(x), float(y), circle.radius * self._mean_step_px)

    @property
    def _mean_step_px(self) -> float:
        return math.sqrt(self.step_px.prod())

    def table(self) -> ResamplingTable:
        """Return the camera pixel of each node; rays are assumed to be vertical."""
        grid = MembraneGrid(self.x_mm, self.y_mm, self.pitch_mm)
        pixels = (self._pixels(axis).astype(np.float32) for axis in (0, 1))
        u, v = (np.ascontiguousarray(a) for a in np.meshgrid(*pixels))
        ray_slope = np.zeros((*self.shape, 2), np.float32)
        return ResamplingTable(grid, u, v, np.ones(self.shape, np.bool_), ray_slope)
