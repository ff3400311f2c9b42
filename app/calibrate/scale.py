"""The step of the scale: an object of known size, pressed into the membrane."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.calibrate.detection import (
    Detection,
    Detector,
    beside,
    or_refusal,
    refuse_grey,
    refuse_size,
    too_early,
)
from app.calibrate.image_step import ImageStep
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb
from app.live.overlay import Circle, Marker, Overlay
from gelpolight_core.calibration.in_place import SCALE
from gelpolight_core.calibration.in_place_session import stated_grid
from gelpolight_core.finding import Finding
from gelpolight_core.image.linear import linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.in_place.scale import find_pins, find_punch
from gelpolight_core.session.session import InPlace
from gelpolight_core.translation import tr


def detect_scale(
    rgb: Rgb, background: Rgb, *, stated: InPlace, response: CameraResponse | None = None
) -> Detection:
    """Find the pressed object, and show what it says about the size of a pixel.

    Parameters
    ----------
    rgb, background : (rows, columns, 3)
        The frame, and the untouched membrane.
    stated : InPlace
        Size of the object, and the membrane's part of the image.
    response : CameraResponse, optional
        Response of the camera.
    """

    def detect() -> Detection:
        refuse_grey(rgb)
        refuse_size(rgb, (background.shape[1], background.shape[0]))
        images = [linear_image(raw, "", response=response) for raw in (rgb, background)]
        grid, pressed = stated_grid(stated, images[1].size), stated.pressed_scale
        seen, bare = (grid.cut(image.rgb) for image in images)
        left, top = grid.region[:2]
        if pressed.pin_spacing_mm is not None:
            pins = find_pins(seen, bare, where=tr("Image"))
            at = pins.pins_px + np.array([left, top])
            marks = Overlay(markers=tuple(Marker(u, v, "dot", "good") for u, v in at))
            x, y = pressed.pin_spacing_mm / pins.spacing_px
            text = tr("{n} pins found: a pixel is {x:.4f} mm wide and {y:.4f} mm high.")
            said = text.format(n=len(at), x=x, y=y)
        else:
            disc = find_punch(seen, bare, where=tr("Image"))
            circle = Circle(left + disc.x, top + disc.y, disc.radius, "good")
            marks = Overlay(circles=(circle,))
            wide = (pressed.punch_diameter_mm or 0.0) / (2.0 * disc.radius)
            said = tr("Contact of the punch found: a pixel is {s:.4f} mm wide.").format(s=wide)
        return Detection(marks, Finding("found", said))

    return or_refusal(detect)


class ScaleStep(ImageStep):
    """Measures the size of a pixel on images of a pressed pin grid or flat punch."""

    step = step_of(
        SCALE,
        tr(
            "Press the pin grid or the flat punch straight into the membrane, at a new place for "
            "each image."
        ),
        "indenter",
        frames=4,
        wanted=3,
        advice=tr("The size of a pixel is measured on it. Its own size is stated in the set-up."),
    )

    def detector(self, name: str) -> Detector:
        """Return the detection of the pressed object beside the background."""
        session = self.model.project.session
        files = session.found("background")
        if not files:
            return too_early
        stated, response = session.in_place or InPlace(), session.response

        def detect(rgb: Rgb, bare: Rgb | None) -> Detection:
            assert bare is not None  # there is a file
            return detect_scale(rgb, bare, stated=stated, response=response)

        return beside(files, detect)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the size of the pressed object, and the background."""
        session = self.model.project.session
        return session.in_place, session.found("background")
