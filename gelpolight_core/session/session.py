"""Read a session folder: its description (session.toml) and the images of each stage.

A session is of a closed sensor where ``session.toml`` has a table ``[in_place]``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.codec import pack, place, unpack_toml
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.limits import FileName, OneOf, Span, Words
from gelpolight_core.base.safe_reading import NAME_LIMIT, short_repr
from gelpolight_core.geometry.membrane_file import height_field
from gelpolight_core.geometry.membrane_shape import FLAT, HEIGHT_FIELD, SHAPES, MembraneShape
from gelpolight_core.image.image_file import MAX_PIXELS
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.image.response import CameraResponse, declared_response

from .board import BoardSpec
from .camera_settings import MOST, CameraSettings
from .decisions import Decisions, read_decisions
from .inventory import IN_PLACE, SessionInventory
from .reference_object import LENGTH_KEYS, RANGE_MM, TEXT_KEYS
from .session_images import SessionImages

FORMAT = "gelpolight-session"
VERSION = 1
ELASTOMER = "elastomer"
"""A name in descriptions by older programs, which is not read."""
INDENTERS, MEMBRANE, WHITEBOARD = "indenters", "membrane", "whiteboard"
# Diamond has 2.42; no clear elastomer or window has a higher index.
Index = Annotated[float, Span(1.0, 2.5)]
Diameter = Annotated[float, Span(0.5, 1000.0)]
NOT_IN_A_NAME = '/\\:*?"<>|'
"""Characters that the name of a folder cannot have everywhere; files are named by the serial."""
SCALE_RANGE = (1e-4, 10.0)
PUNCH_RANGE = (0.1, 100.0)
HALF_ANGLE_RANGE = (10.0, 85.0)
"""Of LEDs, from spot lights to lamps that shine to all sides."""
Scale = Annotated[float, Span(*SCALE_RANGE)]
Corner = Annotated[int, Span(0, MAX_PIXELS)]
Side = Annotated[int, Span(1, MAX_PIXELS)]
Punch = Annotated[float, Span(*PUNCH_RANGE)]
HalfAngle = Annotated[float, Span(*HALF_ANGLE_RANGE)]
Radius = Annotated[float, Span(0.05, 500.0)]
Reflectance = Annotated[float, Span(0.3, 1.0)]
Serial = Annotated[str, Words(NAME_LIMIT)]
ImageName = Annotated[str, FileName()]


@dataclass(frozen=True, slots=True)
class SensorData:
    """The sensor as described by its maker, with lengths in mm (session.toml, ``[sensor]``).

    A closed sensor has only a serial; the rest is without meaning. The half angle is that of the
    LED's data sheet: at this angle from its axis, its intensity is half of that on the axis (60: a
    Lambertian lamp).
    """

    serial: str
    led_height_mm: Annotated[float, Span(0.1, 500.0)] = place(default=0.0, needed=True)
    elastomer_thickness_mm: Annotated[float, Span(0.0, 500.0)] = place(default=0.0, needed=True)
    elastomer_refractive_index: Index = place(default=0.0, needed=True)
    window_thickness_mm: Annotated[float, Span(0.0, 100.0)] = 0.0
    window_refractive_index: Index = 1.49
    working_diameter_mm: Diameter = place(default=0.0, needed=True)
    # No reconstruction uses it: identities are without it.
    led_half_angle_deg: HalfAngle | None = field(default=None, repr=False)


def serial_fault(serial: str) -> str:
    """Return why a text cannot be a serial number, as a clause, or an empty text."""
    if not serial.strip():
        return "is empty"
    if set(serial) & set(NOT_IN_A_NAME) or not serial.isprintable() or serial[0] == ".":
        return f"must not start with a dot, or contain any of {' '.join(NOT_IN_A_NAME)}"
    if len(serial) > NAME_LIMIT:
        return f"has more than {NAME_LIMIT} characters"
    return ""


@dataclass(frozen=True, slots=True)
class ScaleReference:
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
class ClosedSensorSettings:
    """What is stated for the calibration of a closed sensor (session.toml, ``[in_place]``).

    Attributes
    ----------
    mm_per_px : (x, y) or None
        Size of a pixel on the membrane; None where it is measured on ``scale/``.
    mm_per_px_sd : float or None
        Its standard deviation, where that is stated.
    pin_spacing_mm, punch_diameter_mm : float or None
        As in :class:`ScaleReference`.
    region_px : (x, y, width, height) or None
        The membrane's part of the image; None for all of it.
    """

    mm_per_px: tuple[Scale, Scale] | None = None
    mm_per_px_sd: Annotated[float, Span(0.0, SCALE_RANGE[1])] | None = None
    pin_spacing_mm: Punch | None = None
    punch_diameter_mm: Punch | None = None
    region_px: tuple[Corner, Corner, Side, Side] | None = None

    @property
    def pressed_scale(self) -> ScaleReference:
        """The object in the images of ``scale/``."""
        return ScaleReference(self.pin_spacing_mm, self.punch_diameter_mm)

    @property
    def stated_scale(self) -> float | tuple[float, float] | None:
        """`mm_per_px`, as one number where pixels are square."""
        scale = self.mm_per_px
        return scale[0] if scale is not None and scale[0] == scale[1] else scale


@dataclass(frozen=True, slots=True)
class Balls:
    """The radii of the balls (session.toml, ``[balls]``): of most images, and of single ones."""

    default_radius_mm: Radius | None = None
    radius_mm: Mapping[ImageName, Radius] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Camera:
    response: Annotated[str, OneOf("linear", "srgb")] | None = None
    gamma: Annotated[float, Span(0.2, 5.0)] | None = None
    device: Any = None
    controls: Any = None


@dataclass(frozen=True, slots=True)
class _WhiteBoard:
    reflectance: tuple[Reflectance, Reflectance, Reflectance]


@dataclass(frozen=True, slots=True)
class _Membrane:
    shape: Annotated[str, OneOf(*SHAPES)]
    apex_height_mm: float | None = None
    file: ImageName | None = None
    diameter_mm: Diameter | None = None


_Indenter: Any = make_dataclass(
    "_Indenter",
    [(key, Annotated[float, Span(*RANGE_MM)] | None, None) for key in LENGTH_KEYS]
    + [(key, Annotated[str, Words()] | None, None) for key in TEXT_KEYS],
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """What every session.toml states."""

    balls: Any
    camera: _Camera | None = None
    indenters: Any = None
    membrane: _Membrane | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Opened(_File):
    sensor: SensorData
    checkerboard: BoardSpec
    top_pose: BoardSpec | None = None
    whiteboard: _WhiteBoard | None = None
    response: Mapping[ImageName, Annotated[float, Span(1e-4, 1e6)]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Serial:
    serial: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Closed(_File):
    sensor: _Serial
    in_place: ClosedSensorSettings


@dataclass(frozen=True, slots=True)
class Session(SessionImages):
    """A session folder with its checked description. Images are read on demand.

    Images that the user has excluded (``decisions.toml``) are not among the files of a stage.

    Attributes
    ----------
    folder, sensor
        The folder, and the sensor described in ``session.toml``.
    checkerboard, top_pose : BoardSpec
        The boards; without meaning for a closed sensor.
    board_reflectance : tuple of 3 floats or None
        From ``[whiteboard]``: diffuse reflectance of the white board for each channel.
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
    in_place : ClosedSensorSettings or None
        From ``[in_place]``; None for a sensor that can be opened.
    surface : MembraneShape
        From ``[membrane]``: the undeformed membrane, with its axis at the origin, which is in the
        middle of the image for a closed sensor.
    indenters : mapping
        From ``[indenters]``: what is stated of each object that is pressed, by its name.
    inventory : SessionInventory
        The files of the folder.
    """

    folder: Path
    sensor: SensorData
    checkerboard: BoardSpec = field(default_factory=BoardSpec)
    top_pose: BoardSpec = field(default_factory=BoardSpec)
    board_reflectance: tuple[float, float, float] | None = None
    ball_radii_mm: Mapping[str, float] = field(default_factory=dict)
    ball_default_radius_mm: float | None = None
    declared_response: str | float | None = None
    exposures_ms: Mapping[str, float] = field(default_factory=dict)
    response: CameraResponse | None = None
    decisions: Decisions = field(default_factory=Decisions)
    camera_settings: CameraSettings | None = None
    in_place: ClosedSensorSettings | None = None
    surface: MembraneShape = FLAT
    indenters: Mapping[str, Mapping[str, str | float]] = field(default_factory=dict)
    inventory: SessionInventory = field(
        default_factory=lambda: SessionInventory(Path()), compare=False, repr=False
    )

    def __post_init__(self) -> None:
        """Take the inventory of the session's own folder."""
        if self.inventory.folder != self.folder:
            object.__setattr__(self, "inventory", SessionInventory(self.folder))

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
            text = f"[response] has no exposure time in ms for {name}"
            if name not in names:
                text = f"[response] lists {name}, but there is no such image"
            raise InputError(text, self.folder / "session.toml", Remedy.CORRECT_FILE)
        return images, tuple(self.exposures_ms[image.name] for image in images)

    def single_led(self) -> tuple[LinearImage, ...]:
        """Return the images of the whiteboard with only the red, green or blue LED on.

        Raises
        ------
        InputError
            If one of the three is missing, or there are others.
        """
        by_name = {Path(p.name).stem.casefold(): p for p in self.images("single_led")}
        names = [path.name for path in self.files("single_led")]
        if set(by_name) != set(CHANNEL_KEYS) or len(by_name) != len(names):
            text = f"The folder contains {', '.join(names)} instead of red, green and blue"
            raise InputError(text, self.folder / "single_led", Remedy.SINGLE_LED)
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
    return parse_session(SessionInventory(folder))


def parse_session(inventory: SessionInventory) -> Session:
    """Return the session that is described in a folder.

    Raises
    ------
    InputError
        As :func:`read_session`.
    """
    content, path = inventory.description, inventory.path
    kind: type[_Opened | _Closed] = _Closed if inventory.closed else _Opened
    file = unpack_toml(kind, _as_written_now(content), path, (FORMAT, VERSION))
    if fault := serial_fault(file.sensor.serial):
        raise _wrong(f"[sensor] serial {fault}", path)
    if isinstance(file, _Closed):
        one = (file.in_place.pin_spacing_mm is None) != (file.in_place.punch_diameter_mm is None)
        if file.in_place.mm_per_px is None and not one:
            text = "[in_place] has no mm_per_px, pin_spacing_mm or punch_diameter_mm"
            raise InputError(text, path, Remedy.STATE_IN_SESSION)
        by_kind: dict[str, Any] = {
            "sensor": SensorData(file.sensor.serial),
            "in_place": file.in_place,
        }
    else:
        by_kind = {
            "sensor": file.sensor,
            "checkerboard": file.checkerboard,
            "top_pose": file.top_pose or file.checkerboard,
            "board_reflectance": file.whiteboard and file.whiteboard.reflectance,
            "exposures_ms": file.response,
        }
    balls, declared = parse_balls(inventory), _declared(file.camera, path)
    return Session(
        path.parent,
        ball_radii_mm=balls.radius_mm,
        ball_default_radius_mm=balls.default_radius_mm,
        declared_response=declared,
        response=declared_response(declared),
        decisions=read_decisions(path.parent),
        camera_settings=_settings(file.camera, path),
        surface=_surface(file, path),
        indenters=parse_indenters(inventory),
        inventory=inventory,
        **by_kind,
    )


def _as_written_now(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a description as this program writes it: without what only older ones have."""
    newer = {key: dict(v) if isinstance(v, dict) else v for key, v in content.items()}
    if isinstance(sensor := newer.get("sensor"), dict):
        sensor.pop(ELASTOMER, None)
    board = newer.get(WHITEBOARD)
    if isinstance(board, dict) and isinstance(share := board.get("reflectance"), int | float):
        board["reflectance"] = [share, share, share]
    in_place = newer.get(IN_PLACE)
    if isinstance(in_place, dict) and isinstance(scale := in_place.get("mm_per_px"), int | float):
        in_place["mm_per_px"] = [scale, scale]
    return newer


def parse_balls(inventory: SessionInventory) -> Balls:
    """Return ``[balls]`` of a session.toml.

    Older descriptions have ``default`` and the names of the files in ``[balls]`` itself.

    Raises
    ------
    InputError
        If a key is unknown, or a value of the wrong type or out of range.
    """
    path = inventory.path
    table: Any = inventory.description.get("balls")
    older: dict[str, Any] = {}
    if isinstance(table, dict):
        older = {key: value for key, value in table.items() if key not in Balls.__annotations__}
        table = {key: value for key, value in table.items() if key not in older}
    balls = unpack_toml(Balls, table, path, table="balls")
    kind: Any = Mapping[ImageName, Radius]
    older_radii = unpack_toml(kind, older, path, table="balls")
    twice = sorted(older_radii.keys() & balls.radius_mm.keys())
    if twice or ("default" in older_radii and balls.default_radius_mm is not None):
        raise _wrong(f"[balls] {short_repr((*twice, 'default')[0])} is stated twice", path)
    usual = older_radii.pop("default", balls.default_radius_mm)
    return Balls(usual, older_radii | balls.radius_mm)


def parse_indenters(inventory: SessionInventory) -> dict[str, dict[str, str | float]]:
    """Return ``[indenters]`` of a session.toml: what is stated of each object, by its name.

    Raises
    ------
    InputError
        If a key is unknown, or a value of the wrong type or out of range.
    """
    kind: Any = Mapping[Annotated[str, Words()], _Indenter]
    table = inventory.description.get(INDENTERS, {})
    indenters = unpack_toml(kind, table, inventory.path, table=INDENTERS)
    return {name: pack(indenter, {}, "") for name, indenter in indenters.items()}


def _surface(file: _Opened | _Closed, path: Path) -> MembraneShape:
    """Return the undeformed membrane. A closed sensor states its diameter there, too."""
    membrane = file.membrane
    if membrane is None or membrane.shape == FLAT.shape:
        return FLAT
    diameter_mm = membrane.diameter_mm
    if isinstance(file, _Opened):
        if diameter_mm is not None:
            raise _wrong("[membrane] diameter_mm is unknown: it is working_diameter_mm", path)
        diameter_mm = file.sensor.working_diameter_mm
    if diameter_mm is None:
        raise _wrong("[membrane] diameter_mm is missing", path)
    if membrane.shape == HEIGHT_FIELD:
        if membrane.file is None:
            raise _wrong("[membrane] file is missing", path)
        return height_field(path.parent, membrane.file, diameter_mm)
    height_mm: Any = Annotated[float, Span(0.0, 0.5 * diameter_mm)]
    height_mm = unpack_toml(
        height_mm, membrane.apex_height_mm, path, table="membrane.apex_height_mm"
    )
    return MembraneShape(membrane.shape, height_mm, diameter_mm)


def _declared(camera: _Camera | None, path: Path) -> str | float | None:
    """Return the declared response: one of two names, or a gamma."""
    if camera is None:
        return None
    if camera.response and camera.gamma:
        raise _wrong("[camera] response cannot be combined with a gamma", path)
    if not (camera.response or camera.gamma or camera.device):
        raise _wrong("[camera] response is missing", path)
    return camera.response or camera.gamma


def _settings(camera: _Camera | None, path: Path) -> CameraSettings | None:
    if camera is None or camera.device is None:
        return None
    tables = {"device": camera.device, "controls": camera.controls or {}}
    settings = unpack_toml(CameraSettings, tables, path, table="camera")
    if len(settings.controls) > MOST:
        raise _wrong("[camera.controls] has more settings than any camera", path)
    return settings


def _wrong(found: str, path: Path) -> InputError:
    return InputError(found, path, Remedy.CORRECT_ENTRY)
