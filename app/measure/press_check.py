"""Position of the next press in the image, and whether the camera sees it there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.live.live_detection import Detection
from app.live.overlay import Line, Marker, Overlay, Role
from app.measure.placing import kind_label
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.measurement.press import Press
from gelpolight_core.measurement.steadiness import find_contact
from gelpolight_core.reconstruction.background_shift import background_shift
from gelpolight_core.reference import Truth
from gelpolight_core.sensor_calibration import Calibration

Array = NDArray[np.float64]

TOLERANCE_MM = 1.5
"""Allowed distance of an object from its position: the accuracy of placing by hand."""
OUTLINE_POINTS = 72


@dataclass(frozen=True, slots=True)
class Target:
    """A press in image coordinates.

    Attributes
    ----------
    press : Press
        The requested press.
    outline_px : (N, 2)
        Closed outline of the object's face.
    circle_px : (N, 2)
        Closed line within which its centre may be.
    centre_px : (float, float)
        Its centre.
    pixels_per_mm : float
        Scale there.
    """

    press: Press
    outline_px: Array
    circle_px: Array
    centre_px: tuple[float, float]
    pixels_per_mm: float

    def overlay(self, role: Role = "expected") -> Overlay:
        """Return the overlay of the live image."""
        u, v = self.centre_px
        marker = Marker(u, v, "plus", role, object_name(self.press.truth))
        lines = (
            Line(self.outline_px, role, closed=True),
            Line(self.circle_px, "info", closed=True),
        )
        return Overlay(markers=(marker,), lines=lines)


def make_target(press: Press, calibration: Calibration) -> Target:
    """Return a press in image coordinates, through the calibration of the sensor."""
    centre = np.array(press.position_mm)
    one_mm = calibration.data.to_pixels(centre + np.array([[-0.5, 0.0], [0.5, 0.0]]))
    u, v = calibration.data.to_pixels(centre[None])[0]
    return Target(
        press,
        calibration.data.to_pixels(centre + _face(press)),
        calibration.data.to_pixels(centre + _circle(TOLERANCE_MM)),
        (float(u), float(v)),
        float(np.linalg.norm(one_mm[1] - one_mm[0])),
    )


def object_name(truth: Truth) -> str:
    """Return the name of an object, such as "Cylinder 5 mm, height 1 mm"."""
    return f"{kind_label(truth.shape)} {truth.size_mm:g} mm, height {truth.height_mm:g} mm"


class PressCheck:
    """Checks live frames for one press. Called in the processing thread.

    Attributes
    ----------
    phase : str
        ``lift`` until the bare membrane was seen, then ``press``, and ``hold`` while the object is
        pressed in at its position.

    Parameters
    ----------
    target : Target
        Object and position.
    bare : (rows, columns, 3) uint8 or uint16
        The untouched membrane.
    """

    def __init__(self, target: Target, bare: NDArray[Any]) -> None:
        self.phase = "lift"
        self._target, self._bare = target, bare

    def __call__(self, rgb: NDArray[Any]) -> Detection:
        """Check a frame of the press: it passes if the object is pressed in at its position."""
        target, bare = self._target, self._bare
        if rgb.shape != bare.shape or rgb.dtype != bare.dtype:
            text = "The size of the camera image has changed. Capture the bare membrane again."
            return Detection(target.overlay("bad"), _not_yet("size", text))
        contact = find_contact(bare, rgb)
        if self.phase == "lift":
            if not contact.lifted:
                text = "Lift everything off the sensor."
                return Detection(target.overlay(), _not_yet("lift", text))
            self.phase = "press"
        if not contact.pressed:
            self.phase = "press"
            text = "Press the object in at the mark until its base touches."
            return Detection(target.overlay(), _not_yet("press", text))
        away_mm = math.dist(contact.centre_px, target.centre_px) / target.pixels_per_mm
        if away_mm > TOLERANCE_MM:
            self.phase = "press"
            text = "The object is {away:.1f} mm from the mark. Lift it and press it at the mark."
            return Detection(target.overlay("bad"), _not_yet("away", text.format(away=away_mm)))
        self.phase = "hold"
        return Detection(target.overlay("good"), Finding("hold", "Hold it still."))


def _not_yet(key: str, text: str) -> Finding:
    return Finding(key, text, verdict=Verdict.WARN)


def _face(press: Press) -> Array:
    half = 0.5 * press.truth.size_mm
    if press.truth.shape == "cylinder":
        return _circle(half)
    yaw = math.radians(press.yaw_deg)
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    along = np.linspace(-half, half, OUTLINE_POINTS // 4, endpoint=False)
    side = np.full_like(along, half)
    corners = [(along, -side), (side, along), (-along, side), (-side, -along)]
    points = np.concatenate([np.stack(pair, axis=-1) for pair in corners])
    return np.asarray(points @ turn)


def _circle(radius_mm: float) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, OUTLINE_POINTS, endpoint=False)
    return radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def why_not_bare(rgb: NDArray[Any], calibration: Calibration) -> str:
    """Return why an image cannot be that of the bare membrane. Empty if it can.

    Parameters
    ----------
    rgb : (height, width, 3) uint8 or uint16
        The image.
    calibration : Calibration
        Of the sensor. Its background is the membrane with nothing on it.
    """
    try:
        touched = background_shift(rgb, calibration).touched
    except InputError as error:
        return str(error)
    if not touched:
        return ""
    return (
        "Something presses on the membrane. Lift everything off the sensor, then click "
        '"Capture bare membrane".'
    )
