"""The session of a closed sensor: a background, ball presses and the scale, nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError
from gelpolight_core.image.response import CameraResponse, declared_response
from gelpolight_core.session.camera_settings import CameraSettings, parse_settings
from gelpolight_core.session.decisions import Decisions, read_decisions
from gelpolight_core.session.images import SessionImages
from gelpolight_core.session.missing import refuse_undescribed
from gelpolight_core.session.session import (
    ELASTOMER,
    FORMAT,
    VERSION,
    Session,
    parse_radii,
    parse_response,
    parse_session,
    read_description,
)
from gelpolight_core.session.table import Table
from gelpolight_core.translation import tr

IN_PLACE = "in_place"
STAGES = ("background", "balls")
SCALE_RANGE = (1e-4, 10.0)
PUNCH_RANGE = (0.1, 100.0)


@dataclass(frozen=True, slots=True)
class PressedScale:
    """The object in the images of ``scale/``.

    Attributes
    ----------
    pin_spacing_mm : float or None
        Distance between neighbouring pins of a square grid.
    punch_diameter_mm : float or None
        Diameter of a flat round punch.
    """

    pin_spacing_mm: float | None = None
    punch_diameter_mm: float | None = None


@dataclass(frozen=True, slots=True)
class ClosedSession(SessionImages):
    """A closed sensor's session folder whose description was read and checked.

    Attributes
    ----------
    folder : Path
        Where it is.
    serial : str
        Of the sensor.
    mm_per_px : float or None
        The stated scale; None where it is measured on ``scale/``.
    mm_per_px_sd : float or None
        Its standard deviation, where that is stated.
    pressed_scale : PressedScale
        The object in the images of ``scale/``.
    ball_radii_mm, ball_default_radius_mm
        Of ``[balls]``.
    declared_response : str, float or None
        Of ``[camera]``: ``linear``, ``srgb``, or a gamma; None where nothing is declared.
    response : CameraResponse or None
        What that is; None where images are used as they are.
    decisions : Decisions
        Of ``decisions.toml``.
    camera_settings : CameraSettings or None
        Of ``[camera.device]`` and ``[camera.controls]``.
    elastomer : str
        Of ``[sensor]``: name or serial number of the elastomer; empty if not stated.
    """

    folder: Path
    serial: str
    mm_per_px: float | None
    mm_per_px_sd: float | None = None
    pressed_scale: PressedScale = PressedScale()
    ball_radii_mm: Mapping[str, float] = field(default_factory=dict)
    ball_default_radius_mm: float | None = None
    declared_response: str | float | None = None
    response: CameraResponse | None = None
    decisions: Decisions = field(default_factory=Decisions)
    camera_settings: CameraSettings | None = None
    elastomer: str = ""

    @property
    def stages(self) -> tuple[str, ...]:
        """Folders of the images that a calibration uses."""
        return (*STAGES, "scale") if self.mm_per_px is None else STAGES


def read_any_session(folder: Path) -> Session | ClosedSession:
    """Read a session folder, of an open or of a closed sensor.

    A session is a closed sensor's where ``session.toml`` has a table ``[in_place]``.

    Raises
    ------
    InputError
        If the description cannot be used. Where tables of the open stages are missing, one message
        lists everything that is missing and offers the closed route.
    """
    content, path = read_description(folder), folder / "session.toml"
    if IN_PLACE in content:
        return parse_closed_session(content, path)
    refuse_undescribed(content, folder)
    return parse_session(content, path)


def parse_closed_session(content: dict[str, Any], path: Path) -> ClosedSession:
    """Return the session that the content of a closed sensor's session.toml describes.

    Raises
    ------
    InputError
        If a key is unknown, missing, of the wrong kind or out of range; `path` is named.
    """
    top = Table(content, "", path)
    top.check_version(FORMAT, VERSION)
    sensor, scale = top.table("sensor"), top.table(IN_PLACE)
    camera = top.table("camera") if "camera" in content else Table({}, "camera", path)
    declared = parse_response(camera) if "camera" in content else None
    sensor.no_more("serial", ELASTOMER)
    scale.no_more("mm_per_px", "mm_per_px_sd", "pin_spacing_mm", "punch_diameter_mm")
    top.no_more("format", "version", "sensor", IN_PLACE, "balls", "camera")
    stated = _optional(scale, "mm_per_px", SCALE_RANGE)
    pressed = PressedScale(
        _optional(scale, "pin_spacing_mm", PUNCH_RANGE),
        _optional(scale, "punch_diameter_mm", PUNCH_RANGE),
    )
    if stated is None and (pressed.pin_spacing_mm is None) == (pressed.punch_diameter_mm is None):
        raise InputError(
            tr("[in_place] does not state the scale"),
            where=str(path),
            advice=tr(
                "State mm_per_px; or press a pin grid or a flat punch, put the images in scale/, "
                "and state either pin_spacing_mm or punch_diameter_mm"
            ),
        )
    radii, default = parse_radii(top.table("balls"))
    return ClosedSession(
        path.parent,
        sensor.text("serial"),
        stated,
        _optional(scale, "mm_per_px_sd", (0.0, SCALE_RANGE[1])),
        pressed,
        radii,
        default,
        declared,
        declared_response(declared),
        read_decisions(path.parent),
        parse_settings(camera) if "device" in camera.content else None,
        sensor.optional_text(ELASTOMER),
    )


def _optional(table: Table, key: str, limits: tuple[float, float]) -> float | None:
    return table.number(key, *limits) if key in table.content else None
