"""Find a pressed ball in an image of a closed sensor, beside its background."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from app.calibrate.detection import Detection, or_refusal, read_raw
from app.live.image_checks import Rgb
from app.live.overlay import Circle, Marker, Overlay
from gelpolight_core.errors import InputError
from gelpolight_core.image.linear import linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.in_place.press import find_contact
from gelpolight_core.reconstruction.in_place.change import Reference, reference
from gelpolight_core.reconstruction.in_place.grid import ImageSize, WorkingGrid
from gelpolight_core.translation import tr

Point = tuple[float, float]


@dataclass(frozen=True)
class Untouched:
    """The background, read and prepared when it is first needed, in the processing thread.

    Attributes
    ----------
    path : Path
        Its file.
    mm_per_px : float
        Scale of the images.
    response : CameraResponse or None
        Response of the camera.
    """

    path: Path
    mm_per_px: float
    response: CameraResponse | None

    @cached_property
    def grid(self) -> WorkingGrid:
        """The grid on which images are compared."""
        rows, columns = self._image.shape[:2]
        return WorkingGrid(ImageSize(columns, rows), self.mm_per_px)

    @cached_property
    def base(self) -> Reference:
        """The background on the grid, with its printed markers."""
        return reference(
            self.grid.reduce(linear_image(self._image, "", response=self.response).rgb)
        )

    @cached_property
    def _image(self) -> Rgb:
        return read_raw(self.path)


def detect_closed_ball(
    rgb: Rgb,
    untouched: Untouched,
    *,
    radius_mm: float,
    earlier_px: Sequence[Point] = (),
    next_px: Point | None = None,
) -> Detection:
    """Find a pressed ball.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    untouched : Untouched
        The background.
    radius_mm : float
        Radius of the ball.
    earlier_px : sequence of (u, v)
        Centres of the presses captured before.
    next_px : (u, v), optional
        Where the next press helps most.
    """
    marks = Overlay(markers=tuple(Marker(*at, "dot", "info") for at in earlier_px))
    if next_px is not None:
        ring = Marker(*next_px, "ring", "expected", text=tr("next press"))
        marks = replace(marks, markers=(*marks.markers, ring))

    def detect() -> Detection:
        grid = untouched.grid
        _refuse_size(rgb, grid.image)
        seen = grid.reduce(linear_image(rgb, "", response=untouched.response).rgb)
        radius = radius_mm / grid.pitch_mm
        found, _ = find_contact(seen, untouched.base, ball_radius=radius, name=tr("Image"))
        size = grid.factor
        u, v = (size * c + 0.5 * (size - 1) for c in (found.x, found.y))
        contact = Circle(u, v, size * found.radius, "good")
        text = tr("Ball found: contact radius {c:.2f} mm.")
        return Detection(
            replace(marks, circles=(contact,)),
            text.format(c=found.radius * grid.pitch_mm),
            True,
        )

    return or_refusal(detect, marks=marks)


def _refuse_size(rgb: Rgb, size: ImageSize) -> None:
    if (rgb.shape[1], rgb.shape[0]) != (size.width, size.height):
        raise InputError(
            tr("The image has {a} x {b} pixels, but the background has {c} x {d}").format(
                a=rgb.shape[1], b=rgb.shape[0], c=size.width, d=size.height
            ),
            where=tr("Image"),
            advice=tr("Set the camera to the image size of the background"),
        )


def to_px(x_mm: float, y_mm: float, grid: WorkingGrid) -> Point:
    """Return the camera pixel of a place on the membrane."""
    image, scale = grid.image, grid.mm_per_px
    u, v = x_mm / scale + 0.5 * (image.width - 1), y_mm / scale + 0.5 * (image.height - 1)
    return float(np.clip(u, 0, image.width - 1)), float(np.clip(v, 0, image.height - 1))
