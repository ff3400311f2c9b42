"""Where to press next, in the picture, and whether that is what the camera sees."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection
from app.live.overlay import Line, Marker, Overlay, Role
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.measurement.protocol import PressWanted
from gelpolight_core.measurement.result import Truth
from gelpolight_core.measurement.steadiness import find_contact
from gelpolight_core.optics.refraction import membrane_to_camera
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

TOLERANCE_MM = 1.5
"""How far beside its place an object may be pressed: a hand without a guide finds it so well."""
OUTLINE_POINTS = 72


class PictureMap:
    """From places on the membrane to the picture, through a calibration's optics.

    Parameters
    ----------
    calibration : Calibration
        Of the sensor that is looked at.
    """

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration

    def to_picture(self, points_mm: Array) -> Array:
        """Return where points (N, 2) of the flat membrane are seen, (N, 2) in pixels (u, v)."""
        c = self._calibration
        directions = membrane_to_camera(np.asarray(points_mm, np.float64), c.plane, c.stack)
        return np.asarray(c.camera.project(directions))

    def pixels_per_mm(self, place_mm: tuple[float, float]) -> float:
        """Return the scale of the picture at a place."""
        x, y = place_mm
        ends = self.to_picture(np.array([[x - 0.5, y], [x + 0.5, y]]))
        return float(np.linalg.norm(ends[1] - ends[0]))


@dataclass(frozen=True, slots=True)
class Target:
    """A press in picture coordinates.

    Attributes
    ----------
    press : PressWanted
        What is wanted.
    outline_px : (N, 2)
        Closed outline of the object's face.
    circle_px : (N, 2)
        Closed line within which its middle may be.
    centre_px : (float, float)
        Its middle.
    pixels_per_mm : float
        Scale there.
    """

    press: PressWanted
    outline_px: Array
    circle_px: Array
    centre_px: tuple[float, float]
    pixels_per_mm: float

    def overlay(self, role: Role = "expected") -> Overlay:
        """Return what is drawn over the live picture."""
        u, v = self.centre_px
        marker = Marker(u, v, "plus", role, object_name(self.press.truth))
        lines = (
            Line(self.outline_px, role, closed=True),
            Line(self.circle_px, "info", closed=True),
        )
        return Overlay(markers=(marker,), lines=lines)


def make_target(press: PressWanted, picture: PictureMap) -> Target:
    """Return a press in picture coordinates.

    Parameters
    ----------
    press : PressWanted
        What is wanted, and where.
    picture : PictureMap
        Of the sensor's calibration.
    """
    centre = np.array(press.place_mm)
    u, v = picture.to_picture(centre[None])[0]
    return Target(
        press,
        picture.to_picture(centre + _face(press)),
        picture.to_picture(centre + _circle(TOLERANCE_MM)),
        (float(u), float(v)),
        picture.pixels_per_mm(press.place_mm),
    )


def object_name(truth: Truth) -> str:
    """Return what people call an object, such as "Cylinder 5 mm, height 1 mm"."""
    shape = {"cylinder": tr("Cylinder"), "cuboid": tr("Cuboid")}[truth.shape]
    return tr("{shape} {size:g} mm, height {height:g} mm").format(
        shape=shape, size=truth.size_mm, height=truth.height_mm
    )


class PressLooker:
    """Looks at live frames for one press; called in the processing thread.

    Attributes
    ----------
    phase : str
        ``lift`` until the membrane was seen bare, then ``press``, and ``hold`` where the object is
        pressed in its place.

    Parameters
    ----------
    target : Target
        What is to be pressed, and where.
    bare : (rows, columns, 3) uint8 or uint16
        The membrane that nothing touches.
    """

    def __init__(self, target: Target, bare: NDArray[Any]) -> None:
        self.phase = "lift"
        self._target, self._bare = target, bare

    def __call__(self, rgb: NDArray[Any]) -> Detection:
        """Return what a frame shows of the press."""
        target, bare = self._target, self._bare
        if rgb.shape != bare.shape or rgb.dtype != bare.dtype:
            said = tr("The camera's picture has changed its size: take the bare picture again.")
            return Detection(target.overlay("bad"), said, False)
        contact = find_contact(bare, rgb)
        if self.phase == "lift":
            if not contact.lifted:
                return Detection(target.overlay(), tr("Lift everything off the sensor."), False)
            self.phase = "press"
        if not contact.pressed:
            self.phase = "press"
            said = tr("Press it in at the mark, until its base touches.")
            return Detection(target.overlay(), said, False)
        away_mm = math.dist(contact.centre_px, target.centre_px) / target.pixels_per_mm
        if away_mm > TOLERANCE_MM:
            self.phase = "press"
            said = tr("It is {away:.1f} mm beside the mark: lift it and press it there.")
            return Detection(target.overlay("bad"), said.format(away=away_mm), False)
        self.phase = "hold"
        return Detection(target.overlay("good"), tr("Hold it still."), True)


def _face(press: PressWanted) -> Array:
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
