"""Positions of the pixels of a closed sensor on its membrane.

Lens and layers are unknown. A position is the distance of the pixel from the image centre times the
scale, x right, y down. Large images are averaged over blocks of pixels, because the texture of the
gel limits the resolution more than the camera.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.geometry.resampling import LEAST_NODES, MembraneGrid, ResamplingTable
from gelpolight_core.stages.balls.contact_contour import ImageCircle

FAR = 10.0
"""Distance in corners of a place that the image does not show."""


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
        Size of the camera's images.
    mm_per_px : float
        Size of a camera pixel on the membrane along x.
    aspect : float
        Size of a camera pixel along y over its size along x.
    region_px : (x, y, width, height) or None
        The membrane's part of the image; None for all of it.
    lens : tuple of float
        Terms k1, k2, ... of a wide lens: a pixel at the distance r from the middle of the image
        shows what a lens without distortion would show at r (1 + k1 r2 + k2 r4 + ...); r is 1 at
        the corner. The scale is that in the middle.
    surface : MembraneShape
        The undeformed membrane; its axis is in the middle of the image.
    """

    image: ImageSize
    mm_per_px: float
    aspect: float = 1.0
    region_px: tuple[int, int, int, int] | None = None
    lens: tuple[float, ...] = ()
    surface: MembraneShape = FLAT

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
                (
                    f"The region {list(self.region)} is not inside the image of {self.image.width} "
                    f"x {self.image.height} pixels or below {LEAST_NODES}"
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
        # About 320 nodes along the longer side of the grid.
        return max(1, round(max(self.region[2], self.region[3] * self.aspect) / 320))

    @property
    def step_px(self) -> Float64Array:
        """Camera pixels (2,) along x and y between neighbouring nodes."""
        return np.array([self.factor, self.factor / self.aspect])

    @property
    def pixel_mm(self) -> Float64Array:
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
    def x_mm(self) -> Float64Array:
        """Places of the columns."""
        return self._positions(0)

    @property
    def y_mm(self) -> Float64Array:
        """Places of the rows."""
        return self._positions(1)

    @property
    def rest(self) -> MembraneShape:
        """The undeformed membrane, in nodes."""
        return self.surface.in_units(self.pitch_mm, (float(self.x_mm[0]), float(self.y_mm[0])))

    def _pixels(self, axis: int) -> Float64Array:
        pixels = self.step_px[axis] * np.arange(self.shape[1 - axis]) + self._first_px[axis]
        return np.asarray(pixels)

    def _positions(self, axis: int) -> Float64Array:
        return np.asarray((self._pixels(axis) - self.middle_px[axis]) * self.pixel_mm[axis])

    @property
    def _first_px(self) -> Float64Array:
        return np.array(self.region[:2]) + 0.5 * (self.step_px - 1.0)

    @property
    def middle_px(self) -> Float64Array:
        """The middle (2,) of the image."""
        return np.asarray(0.5 * (np.array([self.image.width, self.image.height]) - 1.0))

    def cut(self, rgb: Float32Array) -> Float32Array:
        """Return the membrane's part of an image (height, width, 3)."""
        x, y, width, height = self.region
        return rgb[y : y + height, x : x + width]

    def reduce(self, rgb: Float32Array) -> Float32Array:
        """Return an image (height, width, 3) averaged over each node's block."""
        rows, columns = self.shape
        if self.lens:
            u, v = _camera_pixels(self)
            rgb = np.asarray(cv2.remap(rgb, u, v, cv2.INTER_LINEAR), np.float32)
        # Whole pixels are averaged; what is left of the step along y is interpolated.
        tall = max(1, int(self.step_px[1]))
        remaining_step = self.step_px[1] / tall
        part = self.cut(rgb)
        if self.factor > 1 or tall > 1:
            size = columns, len(part) // tall
            whole = np.ascontiguousarray(part[: size[1] * tall, : columns * self.factor])
            part = np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.float32)
        if remaining_step == 1.0:
            return part
        x, y = np.arange(columns), remaining_step * np.arange(rows) + 0.5 * (remaining_step - 1.0)
        u, v = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
        return np.asarray(cv2.remap(part, u, v, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE))

    def to_pixels(self, points_mm: NDArray[np.floating]) -> Float64Array:
        """Return the camera pixels (N, 2) at positions (N, 2) on the membrane."""
        pixels = np.asarray(points_mm / self.pixel_mm + self.middle_px, np.float64)
        return self.through_lens(pixels)

    def through_lens(self, pixels: NDArray[np.floating], *, back: bool = False) -> Float64Array:
        """Return camera pixels (N, 2) for pixels of a lens without distortion, or back.

        What lies beyond the corner of the image is far outside of it.
        """
        if not self.lens:
            return np.asarray(pixels, np.float64)
        corner = float(np.linalg.norm(self.middle_px))
        radii = _radii(self.lens)
        offset = (np.asarray(pixels, np.float64) - self.middle_px) / corner
        radius = np.linalg.norm(offset, axis=1)
        mapped_radius = np.interp(radius, *(radii if back else radii[::-1]), right=FAR)
        mapped_radius *= corner / np.maximum(radius, 1e-12)
        return np.asarray(offset * mapped_radius[:, None] + self.middle_px)

    def on_nodes(self, circle: ImageCircle) -> ImageCircle:
        """Return a circle in camera pixels as one in nodes."""
        flat = self._circle(circle, back=True)
        x, y = (np.array([flat.x, flat.y]) - self._first_px) / self.step_px
        return ImageCircle(float(x), float(y), flat.radius / self._mean_step_px)

    def in_image(self, circle: ImageCircle) -> ImageCircle:
        """Return a circle in nodes as one in camera pixels."""
        x, y = np.array([circle.x, circle.y]) * self.step_px + self._first_px
        flat = ImageCircle(float(x), float(y), circle.radius * self._mean_step_px)
        return self._circle(flat, back=False)

    def _circle(self, circle: ImageCircle, *, back: bool) -> ImageCircle:
        # Of the same area as its image, by the lens at its middle.
        around = np.array([[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]])
        at = self.through_lens(around + np.array([circle.x, circle.y]), back=back)
        area = abs(float(np.linalg.det([at[1] - at[2], at[3] - at[4]])))
        return ImageCircle(float(at[0, 0]), float(at[0, 1]), circle.radius * math.sqrt(area))

    @property
    def _mean_step_px(self) -> float:
        return math.sqrt(self.step_px.prod())

    def table(self) -> ResamplingTable:
        """Return the camera pixel of each node, with vertical rays."""
        grid = MembraneGrid(self.x_mm, self.y_mm, self.pitch_mm)
        flat = np.stack(np.meshgrid(self._pixels(0), self._pixels(1)), axis=-1).reshape(-1, 2)
        pixels = self.through_lens(flat).astype(np.float32)
        u, v = (np.ascontiguousarray(pixels[:, axis].reshape(self.shape)) for axis in (0, 1))
        inside = np.asarray((np.abs(pixels - self.middle_px) <= self.middle_px + 0.5).all(axis=1))
        ray_slope = np.zeros((*self.shape, 2), np.float32)
        visible = inside.reshape(self.shape)
        return ResamplingTable(grid, u, v, visible, ray_slope, surface=self.surface)


@functools.lru_cache(4)
def _camera_pixels(grid: WorkingGrid) -> tuple[Float32Array, Float32Array]:
    """Return u and v (height, width) in the camera of all pixels without distortion."""
    shape = grid.image.height, grid.image.width
    at = grid.through_lens(np.indices(shape, np.float64)[::-1].reshape(2, -1).T).astype(np.float32)
    u, v = (np.ascontiguousarray(at[:, axis].reshape(shape)) for axis in (0, 1))
    return u, v


def unfolded(lens: tuple[float, ...]) -> bool:
    """Return whether the terms of a lens keep the order of all pixels from the middle outwards."""
    return bool((np.diff(_radii(lens)[1]) > 0.0).all())


def _radii(lens: tuple[float, ...]) -> tuple[Float64Array, Float64Array]:
    """Return radii in the image with those that a lens without distortion would show."""
    radii = np.linspace(0.0, 1.0, 1001)
    return radii, np.asarray(radii * np.polynomial.Polynomial((1.0, *lens))(radii**2))
