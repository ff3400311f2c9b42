"""What the health check reads of a calibration."""

from __future__ import annotations

from typing import Protocol

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.geometry.resampling import (
    ResamplingTable,
)
from gelpolight_core.image.grain import Grain
from gelpolight_core.image.response import CameraResponse


class HasImageSize(Protocol):
    """Size of the camera's images in pixels."""

    @property
    def width(self) -> int:
        """Columns."""

    @property
    def height(self) -> int:
        """Rows."""


class BackgroundReference(Protocol):
    """What a calibration knows of images of the untouched membrane."""

    @property
    def camera(self) -> HasImageSize:
        """The camera, or at least the size of its images."""

    @property
    def noise(self) -> Float64Array:
        """Standard deviation (3,) of a pixel of a single image at median brightness."""

    @property
    def response(self) -> CameraResponse | None:
        """Inverse camera response, or None for a linear camera."""

    @property
    def table(self) -> ResamplingTable:
        """The camera pixel of each node of the membrane grid."""

    @property
    def background(self) -> Float32Array:
        """The untouched membrane as the camera sees it, linear light on the grid."""

    @property
    def grain(self) -> Grain | None:
        """Grain of the calibration's images, or None if it was not measured."""
