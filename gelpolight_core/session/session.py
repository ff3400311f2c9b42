"""Read a session folder: its description (session.toml) and the images of each stage.

A session is of a closed sensor where ``session.toml`` has a table ``[in_place]``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.linear import LinearImage
from gelpolight_core.image.response import CameraResponse, declared_response
from gelpolight_core.io.reading import NAME_LIMIT, is_file_name, read_toml
from gelpolight_core.reference import LENGTH_KEYS, RANGE_MM, TEXT_KEYS
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.camera_settings import CameraSettings, parse_settings
from gelpolight_core.session.decisions import Decisions, read_decisions
from gelpolight_core.session.images import SessionImages
from gelpolight_core.session.table import Table
from gelpolight_core.surface import FLAT, HEIGHT_FIELD, SHAPES, Surface, height_field

FORMAT = "gelpolight-session"
VERSION = 1
ELASTOMER = "elastomer"
"""A name in descriptions by older programs, which is not read."""
INDENTERS = "indenters"
IN_PLACE, MEMBRANE = "in_place", "membrane"
DEFAULT_RADIUS, RADIUS_OF_FILES = RADIUS_KEYS = ("default_radius_mm", "radius_mm")
RADIUS_RANGE_MM = 0.05, 500.0
"""Of ``[balls]``: the radius of most balls, and the table with those of single files."""
COMMON = ("format", "version", "sensor", "balls", "camera", INDENTERS, MEMBRANE)
"""Tables and keys of every session.toml."""
# Diamond has 2.42; no clear elastomer or window has a higher index.
DENSEST_INDEX = 2.5
SENSOR_RANGES = {
    "led_height_mm": (0.1, 500.0),
    "elastomer_thickness_mm": (0.0, 500.0),
    "elastomer_refractive_index": (1.0, DENSEST_INDEX),
    "window_thickness_mm": (0.0, 100.0),
    "window_refractive_index": (1.0, DENSEST_INDEX),
    "working_diameter_mm": (0.5, 1000.0),
}
_SENSOR_DEFAULTS = {"window_thickness_mm": 0.0, "window_refractive_index": 1.49}
NOT_IN_A_NAME = '/\\:*?"<>|'
"""Characters that the name of a folder cannot have everywhere; files are named by the serial."""
SCALE_RANGE = (1e-4, 10.0)
PUNCH_RANGE = (0.1, 100.0)


@dataclass(frozen=True, slots=True)
class SensorData:
    """The sensor as described by its maker; lengths in mm (session.toml, ``[sensor]``).

    A closed sensor has only a serial; its lengths and indices are 0.
    """

    serial: str
    led_height_mm: float = 0.0
    elastomer_thickness_mm: float = 0.0
    elastomer_refractive_index: float = 0.0
    window_thickness_mm: float = 0.0
    window_refractive_index: float = 0.0
    working_diameter_mm: float = 0.0


def serial_fault(serial: str) -> str:
    """Return why a text cannot be a serial number, as a clause; empty if it can."""
    if not serial.strip():
        return "is empty"
    if set(serial) & set(NOT_IN_A_NAME) or not serial.isprintable() or serial[0] == ".":
        return "must not start with a dot, or contain any of {characters}".format(
            characters=" ".join(NOT_IN_A_NAME)
        )
    if len(serial) > NAME_LIMIT:
        return f"has more than {NAME_LIMIT} characters"
    return ""


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
class InPlace:
    """What is stated for the calibration of a closed sensor (session.toml, ``[in_place]``).

    Attributes
    ----------
    mm_per_px : (x, y) or None
        Size of a pixel on the membrane; None where it is measured on ``scale/``.
    mm_per_px_sd : float or None
        Its standard deviation, where that is stated.
    pressed_scale : PressedScale
        The object in the images of ``scale/``.
    region_px : (x, y, width, height) or None
        The membrane's part of the image; None for all of it.
    """

    mm_per_px: tuple[float, float] | None = None
    mm_per_px_sd: float | None = None
    pressed_scale: PressedScale = PressedScale()
    region_px: tuple[int, int, int, int] | None = None

    @property
    def stated_scale(self) -> float | tuple[float, float] | None:
        """`mm_per_px`, as one number where pixels are square."""
        scale = self.mm_per_px
        return scale[0] if scale is not None and scale[0] == scale[1] else scale


@dataclass(frozen=True, slots=True)
class Session(SessionImages):
    """A session folder whose description was read and checked; images are read on demand.

    Images that the user has excluded (``decisions.toml``) are not among the files of a stage.

    Attributes
    ----------
    folder, sensor
        The folder, and the sensor described in ``session.toml``.
    checkerboard, top_pose : BoardSpec
        The boards; without meaning for a closed sensor.
    ball_radii_mm, ball_default_radius_mm
        From ``[balls]``.
    declared_response : str, float or None
        From ``[camera]``: ``linear``, ``srgb``, or a gamma; None if nothing is declared.
    exposures_ms : mapping
        From ``[response]``: exposure time of each of its images.
    response : CameraResponse or None
        Undone when the stages' images are read; as declared until it is measured.
    decisions : Decisions
        From ``decisions.toml``.
    camera_settings : CameraSettings or None
        From ``[camera.device]`` and ``[camera.controls]``: the camera that captured the images,
        with its settings; None if unknown.
    in_place : InPlace or None
        From ``[in_place]``; None for a sensor that can be opened.
    surface : Surface
        From ``[membrane]``: the undeformed membrane, with its axis at the origin, which is in the
        middle of the image for a closed sensor.
    indenters : mapping
        From ``[indenters]``: what is stated of each object that is pressed, by its name.
    """

    folder: Path
    sensor: SensorData
    checkerboard: BoardSpec = field(default_factory=BoardSpec)
    top_pose: BoardSpec = field(default_factory=BoardSpec)
    ball_radii_mm: Mapping[str, float] = field(default_factory=dict)
    ball_default_radius_mm: float | None = None
    declared_response: str | float | None = None
    exposures_ms: Mapping[str, float] = field(default_factory=dict)
    response: CameraResponse | None = None
    decisions: Decisions = field(default_factory=Decisions)
    camera_settings: CameraSettings | None = None
    in_place: InPlace | None = None
    surface: Surface = FLAT
    indenters: Mapping[str, Mapping[str, str | float]] = field(default_factory=dict)

    @property
    def serial(self) -> str:
        """Serial number of the sensor."""
        return self.sensor.serial

    @property
    def optional_stages(self) -> tuple[str, ...]:
        """The optional stages that this session has.

        An empty folder does not count. Exposure times without images do: then images are missing.
        """
        has_series = bool(self.exposures_ms or self.captured("response"))
        has_single = bool(self.captured("single_led"))
        return ("response",) * has_series + ("single_led",) * has_single

    def series(self) -> tuple[tuple[LinearImage, ...], tuple[float, ...]]:
        """Return the images of ``response``, as encoded, and their exposure times (ms).

        Raises
        ------
        InputError
            If an image has no exposure time in ``[response]``, or a time has no image.
        """
        images = replace(self, response=None).images("response")
        names = {image.name for image in images}
        for name in sorted(names ^ set(self.exposures_ms)):
            found = "[response] has no exposure time in ms for {name}"
            if name not in names:
                found = "[response] lists {name}, but there is no such image"
            raise InputError(
                found.format(name=name), self.folder / "session.toml", Remedy.CORRECT_FILE
            )
        return images, tuple(self.exposures_ms[image.name] for image in images)

    def single_led(self) -> tuple[LinearImage, ...]:
        """Return the images of the whiteboard with only the red, green or blue LED on.

        Raises
        ------
        InputError
            If one of the three is missing, or there are others.
        """
        by_name = {Path(p.name).stem.casefold(): p for p in self.images("single_led")}
        if set(by_name) != set(CHANNEL_KEYS) or len(by_name) != len(self.files("single_led")):
            raise InputError(
                "The folder contains {found} instead of red, green and blue".format(
                    found=", ".join(path.name for path in self.files("single_led"))
                ),
                self.folder / "single_led",
                Remedy.SINGLE_LED,
            )
        return tuple(by_name[name] for name in CHANNEL_KEYS)


def read_session(folder: Path) -> Session:
    """Read and check ``session.toml`` of a session folder, of an open or of a closed sensor.

    In addition to the required tables, there may be ``[camera]`` with ``response = "linear"`` (the
    default) or ``"srgb"``, or ``gamma = 2.2``, and with the camera's name, format and settings in
    ``[camera.device]`` and ``[camera.controls]``; and ``[response]`` with the exposure time in ms
    of each image in the folder ``response``, such as ``"exp_01.png" = 2.0``.

    Raises
    ------
    InputError
        If the folder or file is missing, is not TOML, has another format or version, or has a key
        that is unknown, missing, of the wrong type or out of range.
    """
    return parse_session(read_description(folder), folder / "session.toml")


def read_description(folder: Path) -> dict[str, Any]:
    """Return the content of a folder's ``session.toml``.

    Raises
    ------
    InputError
        If the folder or file is missing or is not TOML.
    """
    path = folder / "session.toml"
    missing = InputError("There is no session.toml", folder, Remedy.CHOOSE_SESSION)
    return read_toml(path, missing=missing)


def parse_session(content: dict[str, Any], path: Path) -> Session:
    """Return the session described by the content of a session.toml.

    Raises
    ------
    InputError
        If a key is unknown, missing, of the wrong type or out of range; the message names `path`.
    """
    top = Table(content, "", path)
    top.check_version(FORMAT, VERSION)
    camera = top.table("camera") if "camera" in content else Table({}, "camera", path)
    declared = parse_response(camera) if "camera" in content else None
    own = _parse_in_place(top) if IN_PLACE in content else _parse_opened(top)
    radii, default = parse_radii(top.table("balls"))
    return Session(
        path.parent,
        ball_radii_mm=radii,
        ball_default_radius_mm=default,
        declared_response=declared,
        response=declared_response(declared),
        decisions=read_decisions(path.parent),
        camera_settings=parse_settings(camera) if "device" in camera.content else None,
        indenters=parse_indenters(content, path),
        **own,
    )


def parse_indenters(content: dict[str, Any], path: Path) -> dict[str, dict[str, str | float]]:
    """Return ``[indenters]`` of a session.toml: what is stated of each object, by its name.

    Raises
    ------
    InputError
        If a key is unknown, or a value of the wrong type or out of range.
    """
    listed = Table({INDENTERS: {}} | content, "", path).table(INDENTERS)
    found: dict[str, dict[str, str | float]] = {}
    for name in listed.content:
        stated = listed.table(name)
        stated.no_more(*LENGTH_KEYS, *TEXT_KEYS)
        found[name] = {
            key: stated.text(key) if key in TEXT_KEYS else stated.number(key, *RANGE_MM)
            for key in stated.content
        }
    return found


def _parse_opened(top: Table) -> dict[str, Any]:
    """Return what only the session of an open sensor states."""
    content = top.content
    checkerboard = _parse_board(top.table("checkerboard"))
    series = top.table("response") if "response" in content else Table({}, "response", top.path)
    top.no_more(*COMMON, "checkerboard", "top_pose", "response")
    sensor = _parse_sensor(top.table("sensor"))
    return {
        "sensor": sensor,
        "surface": _parse_surface(top, sensor.working_diameter_mm),
        "checkerboard": checkerboard,
        "top_pose": _parse_board(top.table("top_pose")) if "top_pose" in content else checkerboard,
        "exposures_ms": {name: series.number(name, 1e-4, 1e6) for name in series.file_names()},
    }


def _parse_surface(top: Table, diameter_mm: float | None = None) -> Surface:
    """Return the undeformed membrane that ``[membrane]`` states.

    Parameters
    ----------
    top : Table
        Whose ``[membrane]`` has ``shape`` and ``apex_height_mm`` or, for a height field, ``file``:
        a file beside session.toml that :func:`height_field` reads.
    diameter_mm : float, optional
        Of the boundary; by default ``[membrane]`` states it as ``diameter_mm``.

    Raises
    ------
    InputError
        If a key is unknown, missing or out of range, or the file cannot be used.
    """
    if MEMBRANE not in top.content:
        return FLAT
    table = top.table(MEMBRANE)
    table.no_more("shape", "apex_height_mm", "file", *(() if diameter_mm else ("diameter_mm",)))
    shape = table.text("shape")
    if shape not in SHAPES:
        raise table.wrong("shape", "is none of {names}".format(names=", ".join(SHAPES)))
    if shape == FLAT.shape:
        return FLAT
    if diameter_mm is None:
        diameter_mm = table.number("diameter_mm", *SENSOR_RANGES["working_diameter_mm"])
    if shape != HEIGHT_FIELD:
        height_mm = table.number("apex_height_mm", 0.0, 0.5 * diameter_mm)
        return Surface(shape, height_mm, diameter_mm)
    name = table.text("file")
    if not is_file_name(name):
        raise table.wrong("file", "is not the name of a file beside session.toml")
    return height_field(table.path.parent, name, diameter_mm)


def _parse_in_place(top: Table) -> dict[str, Any]:
    """Return what only the session of a closed sensor states."""
    sensor, stated = top.table("sensor"), top.table(IN_PLACE)
    sensor.no_more("serial", ELASTOMER)
    stated.no_more("mm_per_px", "mm_per_px_sd", "pin_spacing_mm", "punch_diameter_mm", "region_px")
    top.no_more(*COMMON, IN_PLACE)
    found = InPlace(
        _parse_scale(stated),
        _optional(stated, "mm_per_px_sd", (0.0, SCALE_RANGE[1])),
        PressedScale(
            _optional(stated, "pin_spacing_mm", PUNCH_RANGE),
            _optional(stated, "punch_diameter_mm", PUNCH_RANGE),
        ),
        _parse_region(stated),
    )
    pressed = found.pressed_scale
    one = (pressed.pin_spacing_mm is None) != (pressed.punch_diameter_mm is None)
    if found.mm_per_px is None and not one:
        raise InputError(
            "[in_place] has no mm_per_px, pin_spacing_mm or punch_diameter_mm",
            top.path,
            Remedy.STATE_IN_SESSION,
        )
    data = SensorData(_parse_serial(sensor))
    return {"sensor": data, "in_place": found, "surface": _parse_surface(top)}


def _parse_scale(table: Table) -> tuple[float, float] | None:
    """Return the size of a pixel, one number or [x, y]."""
    if isinstance(table.content.get("mm_per_px"), list):
        x, y = table.numbers("mm_per_px", *SCALE_RANGE, count=2)
        return x, y
    one = _optional(table, "mm_per_px", SCALE_RANGE)
    return None if one is None else (one, one)


def _parse_region(table: Table) -> tuple[int, int, int, int] | None:
    stated = table.content.get("region_px")
    if stated is None:
        return None
    whole = isinstance(stated, list) and len(stated) == 4 and all(type(n) is int for n in stated)
    if not whole or min(stated) < 0 or min(stated[2:]) < 1:
        raise table.wrong("region_px", "must be four whole numbers: x, y, width and height")
    x, y, width, height = stated
    return x, y, width, height


def _optional(table: Table, key: str, limits: tuple[float, float]) -> float | None:
    return table.number(key, *limits) if key in table.content else None


def parse_radii(balls: Table) -> tuple[dict[str, float], float | None]:
    """Return the radius (mm) of each named ball, and the default.

    Older descriptions have ``default`` and the names of the files in ``[balls]`` itself.
    """
    stated = balls.content.get(RADIUS_OF_FILES, {})
    if not isinstance(stated, dict):
        raise balls.wrong(RADIUS_OF_FILES, "is not a table")
    defaults = [key for key in (DEFAULT_RADIUS, "default") if key in balls.content]
    if len(defaults) > 1:
        raise balls.wrong(DEFAULT_RADIUS, "is stated twice")
    older = {key: value for key, value in balls.content.items() if key not in RADIUS_KEYS}
    older.pop("default", None)
    radii: dict[str, float] = {}
    for table in (
        Table(older, balls.name, balls.path),
        Table(stated, f"{balls.name}.{RADIUS_OF_FILES}", balls.path),
    ):
        for name in table.file_names():
            if name in radii:
                raise table.wrong(name, "is stated twice")
            radii[name] = table.number(name, *RADIUS_RANGE_MM)
    return radii, balls.number(defaults[0], *RADIUS_RANGE_MM) if defaults else None


def parse_response(table: Table) -> str | float | None:
    """Return the declared response: one of two names, or a gamma."""
    table.no_more("response", "gamma", "device", "controls")
    if "device" in table.content and not {"response", "gamma"} & set(table.content):
        return None
    if "gamma" not in table.content:
        response = table.text("response")
        if response not in ("linear", "srgb"):
            raise table.wrong(
                "response", 'is neither "linear" nor "srgb"; for other curves use gamma = 2.2'
            )
        return response
    if "response" in table.content:
        raise table.wrong("response", "cannot be combined with a gamma")
    return table.number("gamma", 0.2, 5.0)


def _parse_sensor(table: Table) -> SensorData:
    numbers = {
        name: table.number(name, low, high, default=_SENSOR_DEFAULTS.get(name))
        for name, (low, high) in SENSOR_RANGES.items()
    }
    sensor = SensorData(serial=_parse_serial(table), **numbers)
    table.no_more(*SensorData.__dataclass_fields__, ELASTOMER)
    return sensor


def _parse_serial(table: Table) -> str:
    serial = table.text("serial")
    if fault := serial_fault(serial):
        raise table.wrong("serial", fault)
    return serial


def _parse_board(table: Table) -> BoardSpec:
    corners = table.content.get("inner_corners")
    whole = isinstance(corners, list) and len(corners) == 2
    if not whole or not all(type(n) is int and 3 <= n <= 100 for n in corners or ()):
        raise table.wrong("inner_corners", "must be two whole numbers from 3 to 100")
    assert corners is not None
    square = table.number("square_mm", 0.05, 500.0)
    table.no_more("inner_corners", "square_mm")
    return BoardSpec((corners[0], corners[1]), square)
