"""The calibrated data of a closed sensor, whose optics and lights are unknown."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.identity import identity_text
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.health.press_scatter import KINDS, OLDER_KINDS
from gelpolight_core.image.bad_pixels import BadPixels, no_bad_pixels
from gelpolight_core.image.grain import Grain
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.sensor.length_errors import LengthErrors

from .colour_change import SMOOTHING_NODES
from .polynomial_terms import TERMS
from .slope_model import COLOUR_CELLS, InPlaceModel
from .working_grid import ImageSize

MODEL = "in-place"
UNKNOWN = ("optics", "refraction", "temperature")
"""Quantities that in-place calibration cannot determine."""


@dataclass(frozen=True)
class ClosedSensor:
    """All known data of a closed sensor.

    Attributes
    ----------
    serial : str
        Serial number as stated.
    in_place : InPlaceModel
        Background, scale and slopes.
    noise : (3,)
        Standard deviation of a pixel of a single image, per channel.
    balls : tuple of tuple
        Name, x and y of the centre, contact radius and ball radius of each press used, in mm.
    response : CameraResponse or None
        As declared; None where images are used as they are.
    grain : Grain or None
        As of an open sensor.
    """

    serial: str
    in_place: InPlaceModel
    noise: NDArray[np.float64]
    balls: tuple[tuple[str, float, float, float, float], ...]
    response: CameraResponse | None = None
    grain: Grain | None = None

    @property
    def camera(self) -> ImageSize:
        """Size of the camera's images."""
        return self.in_place.grid.image

    @cached_property
    def table(self) -> ResamplingTable:
        """The camera pixel of each node."""
        return self.in_place.grid.table()

    @cached_property
    def bad_pixels(self) -> BadPixels:
        """No bad pixels: a closed sensor is not searched for them."""
        return no_bad_pixels(self.camera.height, self.camera.width)

    @property
    def length_errors(self) -> LengthErrors:
        """Errors of lengths, by presses that were left out and by the scale."""
        model, pitch_mm = self.in_place, self.in_place.grid.pitch_mm
        return LengthErrors(
            # A slope is a ratio of two lengths of the ball; a height is a slope times a length.
            math.hypot(model.errors.depth_share, 2.0 * model.scale_sd),
            model.scale_sd,
            pitch_mm,
            floor_mm=model.errors.depth_floor_mm,
            blur_mm=model.smoothing_nodes * pitch_mm,
        )

    @property
    def leds_mm(self) -> NDArray[np.float64]:
        """None (0, 3): the LEDs of a closed sensor are not located."""
        return np.empty((0, 3))

    @property
    def background(self) -> NDArray[np.float32]:
        """The untouched membrane, linear light on the grid."""
        return self.in_place.background

    def with_background(self, present: NDArray[np.float32]) -> ClosedSensor:
        """Return the data with another image of the untouched membrane, on the grid.

        How its light differs from that of presses is not known, but how theirs scatters.
        """
        light = self.in_place.press_light
        scatter = None if light is None else light - light.mean(axis=0)
        return replace(
            self, in_place=replace(self.in_place, background=present, press_light=scatter)
        )

    def on_grid(self, rgb: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return a camera image (height, width, 3) on the grid (rows, columns, 3)."""
        return self.in_place.grid.reduce(rgb)

    def to_pixels(self, points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the camera pixels (N, 2) that see points (N, 2) of the membrane."""
        return self.in_place.grid.to_pixels(points_mm)

    def digest(self, model: str) -> bytes:
        """Return a hash that changes with any number that a reconstruction uses."""
        del model
        m = self.in_place
        hashed = hashlib.sha256(
            (
                f"(ClosedSensor(serial={self.serial!r}), {identity_text(m.grid)}, "
                f"{m.follow_gain!r})"
            ).encode()
        )
        arrays = [m.background, m.coefficients, m.seen_colours, m.errors.slopes, m.errors.slope_sd]
        if self.response is not None:
            arrays.append(self.response.curves)
        if m.press_light is not None:
            arrays.append(m.press_light)
        if m.smoothing_nodes != SMOOTHING_NODES:  # older files do not state it
            arrays.append(np.float64(m.smoothing_nodes))
        for array in arrays:
            hashed.update(np.ascontiguousarray(array).tobytes())
        return hashed.digest()

    def check(self) -> None:
        """Refuse impossible values.

        Raises
        ------
        ValueError
            With the first of them.
        """
        m, size = self.in_place, self.camera
        nodes = m.errors.slopes
        shapes: tuple[tuple[NDArray[Any], tuple[int, ...]], ...] = (
            (m.background, (*m.grid.shape, 3)),
            (m.coefficients, (TERMS, 2)),
            (m.seen_colours, (COLOUR_CELLS,) * 3),
            (m.errors.slope_sd, (nodes.size,)),
            (self.noise, (3,)),
        )
        if m.press_light is not None:
            kinds = OLDER_KINDS if m.press_light.shape[1:] == (OLDER_KINDS,) else KINDS
            shapes += ((m.press_light, (max(len(m.press_light), 2), kinds)),)
        if not 0 < min(m.grid.shape) or any(array.shape != shape for array, shape in shapes):
            raise ValueError("an array does not fit the size of the images")
        if not (0 < size.width and 0 < size.height and m.grid.mm_per_px > 0.0 < m.steepest):
            raise ValueError("the size of the images or the scale is not possible")
        if not m.smoothing_nodes > 0.0:
            raise ValueError("the smoothing of the images is not possible")
        m.grid.surface.check()
        if nodes.size < 2 or not (np.diff(nodes) > 0.0).all():
            raise ValueError("the errors are not given over rising slopes")
        least = (m.errors.slope_sd, m.background, m.errors.depth_share, m.errors.depth_floor_mm)
        if min(float(np.min(values)) for values in (*least, m.scale_sd)) < 0.0:
            raise ValueError("an error or a background is negative")
