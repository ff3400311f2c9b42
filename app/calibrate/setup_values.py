"""The fields of the set-up form, and their conversion to the description of a session."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from gelpolight_core.base.codec import span_of, unpack_toml
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.form_fields import When, choice, number, text
from gelpolight_core.calibration.closed_sensor.preset import presets, stated_sizes
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.recipes import needs_only_open_sensor
from gelpolight_core.geometry.membrane_file import height_field
from gelpolight_core.geometry.membrane_shape import FLAT, HEIGHT_FIELD, MembraneShape
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.session import (
    HALF_ANGLE_RANGE,
    PUNCH_RANGE,
    SCALE_RANGE,
    ClosedSensorSettings,
    SensorData,
    Serial,
    Session,
    parse_balls,
)

USUAL_RADIUS_MM = 3.0
OTHER = "other"
PRESETS = presets()
USUAL_KIND = "gelsight-mini"
USUAL = PRESETS[USUAL_KIND]
MM = " mm"
NO_ANGLE_DEG = HALF_ANGLE_RANGE[0] - 0.1
"""Lowest value of the form's half angle, below all that can be stated: it is not stated."""


def _opens(values: SetupValues) -> bool:
    return values.optics


def _is_closed(values: SetupValues) -> bool:
    return not values.optics


def _states_scale(values: SetupValues) -> bool:
    return values.source == "stated"


def _optical(name: str, default: float, label: str, tip: str, when: When = _opens) -> Any:
    """Return the field of a length or an index of a sensor that is described by its optics."""
    unit, decimals, step = (MM, 3, 0.1) if name.endswith("_mm") else ("", 4, 0.01)
    span = span_of(SensorData, name)
    return number(default, label, *span, unit, decimals, step=step, tip=tip, when=when)


def _length(default: float, label: str, low: float, high: float, **more: Any) -> Any:
    return number(default, label, low, high, MM, 3, step=0.1, **more)


def _corners(default: int, label: str, **more: Any) -> Any:
    return number(default, label, 3, 100, when=_opens, **more)


def _pressed(source: str, default: float, label: str, tip: str = "") -> Any:
    """Return the field of a length of the object in the images of the scale."""
    return _length(default, label, *PUNCH_RANGE, tip=tip, when=lambda v: v.source == source)


def _pixel(default: float, label: str, low: float, **more: Any) -> Any:
    """Return the field of a stated size of a pixel on the membrane."""
    high = SCALE_RANGE[1]
    return number(default, label, low, high, MM, 5, step=0.0001, when=_states_scale, **more)


@dataclass(frozen=True)
class SetupValues:
    """Values of the set-up form: the optics of a sensor, or the scale of its images.

    Attributes
    ----------
    optics : bool
        Whether the sensor is described by its optics. Otherwise its images have a scale.
    """

    optics: bool = True
    serial: str = text(
        "",
        "Serial number",
        "Identifies the sensor in every file",
        example="for example A-001",
    )
    led_height_mm: float = _optical(
        "led_height_mm",
        14.0,
        "LED height",
        (
            "From the light-emitting points of the LEDs to the top surface; see the drawing of the "
            "housing"
        ),
    )
    led_half_angle_deg: float = number(
        NO_ANGLE_DEG,
        "LED half angle",
        NO_ANGLE_DEG,
        HALF_ANGLE_RANGE[1],
        " deg",
        1,
        tip=(
            "From the axis to where an LED has half of its intensity, in its data sheet: half of "
            "the viewing angle"
        ),
        none="not stated",
        when=_opens,
    )
    elastomer_thickness_mm: float = _optical(
        "elastomer_thickness_mm",
        14.0,
        "Elastomer thickness",
        "Layer of clear silicone below the membrane",
    )
    elastomer_refractive_index: float = _optical(
        "elastomer_refractive_index",
        1.41,
        "Elastomer refractive index",
        "Silicone: about 1.41",
    )
    window_thickness_mm: float = _optical(
        "window_thickness_mm",
        0.0,
        "Window thickness",
        "Rigid plate below the elastomer; 0 if there is none",
    )
    window_refractive_index: float = _optical(
        "window_refractive_index", 1.49, "Window refractive index", "Acrylic: about 1.49"
    )
    working_diameter_mm: float = _optical(
        "working_diameter_mm",
        26.0,
        "Working diameter",
        "Diameter of the circle on the membrane in which the sensor measures",
        when=lambda v: v.optics or v.domed,
    )
    apex_height_mm: float = _length(
        0.0,
        "Height of the membrane",
        0.0,
        0.5 * span_of(SensorData, "working_diameter_mm").high,
        none="flat",
        tip="Of a dome (spherical cap) on its axis, over the plane of its boundary",
        when=lambda v: not v.membrane_file,
    )
    membrane_file: str = text(
        "",
        "Heights of the membrane",
        "File beside session.toml with its shape. Empty: a dome, or flat",
        when=lambda v: bool(v.membrane_file),
    )
    lens_columns: int = _corners(9, "Lens views: inner corners")
    lens_rows: int = _corners(6, "Lens views: inner corners vertically", beside="x")
    lens_square_mm: float = _length(3.0, "Lens views: squares", 0.05, 500.0, when=_opens)
    top_columns: int = _corners(9, "Top surface: inner corners")
    top_rows: int = _corners(6, "Top surface: inner corners vertically", beside="x")
    top_square_mm: float = _length(2.0, "Top surface: squares", 0.05, 500.0, when=_opens)
    preset: str = choice(
        USUAL_KIND,
        "Kind of sensor",
        {k: p.name for k, p in PRESETS.items()} | {OTHER: "Other"},
        when=_is_closed,
    )
    scale_from: str = choice(
        "stated",
        "Scale",
        {
            "stated": "stated here",
            "pins": "from images of a pressed pin grid",
            "punch": "from images of a pressed flat punch",
        },
        "A scale that is 1 % wrong makes every size 1 % wrong. Images measure it",
        when=_is_closed,
    )
    scale: float = _pixel(0.06, "Size of a pixel", SCALE_RANGE[0])
    scale_y: float = _pixel(
        0.0,
        "Height of a pixel",
        0.0,
        tip="Only if pixels are not square: contacts of balls are then all ellipses",
        none="as its width",
    )
    scale_sd: float = number(1.0, "Uncertainty", 0.0, 50.0, " %", 1, when=_states_scale)
    pins: float = _pressed(
        "pins",
        2.0,
        "Distance of the pins",
        "From the centre of a pin to that of the next one, in a square grid",
    )
    punch: float = _pressed("punch", 5.0, "Diameter of the punch")
    region: str = text(
        "",
        "Membrane's region",
        (
            "x, y, width and height in pixels, if the image also shows the housing or mirror "
            "images of the membrane. Empty: the whole image"
        ),
        example="such as 40, 0, 560, 480; empty: all",
        when=_is_closed,
    )
    ball_mm: float = _length(
        2.0 * USUAL_RADIUS_MM,
        "Usual ball diameter",
        0.1,
        1000.0,
        tip="Diameter measured with a calliper; each press can have its own",
    )

    @property
    def source(self) -> str:
        """Origin of the scale, empty for a sensor that is described by its optics."""
        return "" if self.optics else self.scale_from

    @property
    def domed(self) -> bool:
        """Whether the membrane is not flat."""
        return bool(self.membrane_file) or self.apex_height_mm > 0.0

    @property
    def boards(self) -> tuple[BoardSpec, BoardSpec]:
        """The boards of the lens views and of the top surface."""
        lens = BoardSpec((self.lens_columns, self.lens_rows), self.lens_square_mm)
        return lens, BoardSpec((self.top_columns, self.top_rows), self.top_square_mm)


def new_session(*, optics: bool = True) -> Session:
    """Return the default description of a new session, without a folder."""
    values = SetupValues(optics=optics)
    if not optics:
        percent = 100.0 * USUAL.mm_per_px_sd / USUAL.mm_per_px
        values = replace(values, scale=USUAL.mm_per_px, scale_sd=percent)
    empty = Session(Path(), SensorData(""), *values.boards)
    return session_of(empty, values)


def values_of(session: Session) -> SetupValues:
    """Return the values of a session."""
    lens, top, declared = session.checkerboard, session.top_pose, session.in_place
    values = SetupValues(
        True,
        session.serial,
        lens_columns=lens.inner_corners[0],
        lens_rows=lens.inner_corners[1],
        lens_square_mm=lens.square_mm,
        top_columns=top.inner_corners[0],
        top_rows=top.inner_corners[1],
        top_square_mm=top.square_mm,
        ball_mm=2.0 * (session.ball_default_radius_mm or USUAL_RADIUS_MM),
        apex_height_mm=session.surface.apex_height_mm,
        membrane_file=session.surface.file,
    )
    if declared is None:
        stated = asdict(session.sensor)
        stated["led_half_angle_deg"] = stated["led_half_angle_deg"] or NO_ANGLE_DEG
        return replace(values, **stated)
    pressed, (x, y) = declared.pressed_scale, declared.mm_per_px or (values.scale, values.scale)
    kinds = (key for key, p in PRESETS.items() if abs(x - p.mm_per_px) < 5e-6)
    sd, region = declared.mm_per_px_sd, declared.region_px
    source = "pins" if pressed.punch_diameter_mm is None else "punch"
    return replace(
        values,
        optics=False,
        working_diameter_mm=session.surface.diameter_mm or values.working_diameter_mm,
        preset=OTHER if declared.mm_per_px is None else next(kinds, OTHER),
        scale_from=source if declared.mm_per_px is None else "stated",
        scale=x,
        scale_y=0.0 if x == y else y,
        scale_sd=values.scale_sd if sd is None else 100.0 * sd / x,
        pins=pressed.pin_spacing_mm or values.pins,
        punch=pressed.punch_diameter_mm or values.punch,
        region="" if region is None else ", ".join(map(str, region)),
    )


def session_of(session: Session, values: SetupValues) -> Session:
    """Return a session with other values.

    Raises
    ------
    InputError
        If the region is not one, or the file of the membrane cannot be used.
    """
    lens, top = values.boards
    session = replace(
        session,
        checkerboard=lens,
        top_pose=top,
        ball_default_radius_mm=0.5 * values.ball_mm,
        surface=_surface_of(session, values),
    )
    values = replace(values, serial=values.serial.strip())
    if values.optics:
        data = {f.name: getattr(values, f.name) for f in fields(SensorData)}
        if values.led_half_angle_deg < HALF_ANGLE_RANGE[0]:
            data["led_half_angle_deg"] = None
        return replace(session, sensor=SensorData(**data))
    declared = ClosedSensorSettings(region_px=_region(values.region))
    if values.scale_from == "stated":
        scale = values.scale, values.scale_y or values.scale
        sd_mm = 0.01 * values.scale_sd * scale[0]
        declared = replace(declared, mm_per_px=scale, mm_per_px_sd=sd_mm)
    elif values.scale_from == "pins":
        declared = replace(declared, pin_spacing_mm=values.pins)
    else:
        declared = replace(declared, punch_diameter_mm=values.punch)
    return replace(session, sensor=SensorData(values.serial), in_place=declared)


def _surface_of(session: Session, values: SetupValues) -> MembraneShape:
    """Return the undeformed membrane: of the shape that the session has, else a spherical cap."""
    name, width_mm, shape = values.membrane_file, values.working_diameter_mm, session.surface.shape
    if name or not values.domed:
        return height_field(session.folder, Path(name).name, width_mm) if name else FLAT
    shape = "spherical_cap" if shape in (FLAT.shape, HEIGHT_FIELD) else shape
    return MembraneShape(shape, values.apex_height_mm, width_mm)


def _region(words: str) -> tuple[int, int, int, int] | None:
    """Return the region of a text, or None for the whole image."""
    if not words.strip():
        return None
    parts = [part.strip() for part in words.split(",")]
    if len(parts) == 4 and all(map(str.isdecimal, parts)) and min(map(int, parts[2:])) > 0:
        x, y, width, height = map(int, parts)
        return x, y, width, height
    raise InputError(
        f"This is not a region (x, y, width, height in pixels): {words}",
        "Membrane's region",
        Remedy.CORRECT_VALUE,
    )


def preset_text(values: SetupValues) -> str:
    """Return the images that a preset is made for, and sizes to be confirmed, as sentences."""
    if values.preset == OTHER:
        return "State the size of a pixel on the membrane: image an object of known size."
    preset = PRESETS[values.preset]
    sentence = f"For images of {preset.image_px[0]} x {preset.image_px[1]} pixels"
    if any(preset.cropped):
        sentence += (
            f", with {100.0 * max(preset.cropped):.0f} % of the camera image cut off on each side"
        )
    width_mm, height_mm = preset.working_area_mm
    area = f"The visible membrane is {width_mm:g} x {height_mm:g} mm."
    markers = ""
    if any(preset.marker_pitches_mm):
        markers = " Printed markers are found and left out."
    limits = f" {preset.limits}." if preset.limits else ""
    pixel = values.scale, values.scale_y or values.scale
    sizes = stated_sizes((0.5 * values.ball_mm,), pixel, preset.image_px)
    confirm = f"Confirm: {sizes}."
    return f"{sentence}. {area}{markers}{limits} {confirm}"


def in_place_offer(folder: Path) -> Session | None:
    """Return what a folder states for a closed sensor's session, with the folder of its images.

    None if it has no background and ball presses, if nothing of an open sensor is missing, or if
    its description is damaged or already that of a closed sensor.
    """
    offer = replace(new_session(optics=False), folder=folder)
    if not needs_only_open_sensor(offer):
        return None
    inventory = offer.inventory
    if not inventory.path.exists():
        inventory = replace(inventory, content={})
    try:
        if inventory.closed:
            return None
    except InputError:
        return None
    try:
        stated = inventory.description["sensor"]["serial"]
        serial = unpack_toml(Serial, stated, inventory.path, table="sensor.serial")
        balls = parse_balls(inventory)
    except (InputError, LookupError, TypeError):
        return offer  # the form asks for what the folder does not state
    default_radius_mm = balls.default_radius_mm or offer.ball_default_radius_mm
    return replace(
        offer,
        sensor=SensorData(serial),
        ball_radii_mm=balls.radius_mm,
        ball_default_radius_mm=default_radius_mm,
    )


def copy_images(offer: Session, project: CalibrationProject) -> None:
    """Copy background and ball presses of an offer, with their radii, into a new session.

    Raises
    ------
    InputError
        If an image cannot be used.
    """
    project.import_files("background", offer.found("background"))
    by_radius: dict[float, list[Path]] = {}
    for path in offer.found("balls"):
        by_radius.setdefault(offer.ball_radius_mm(path.name), []).append(path)
    for radius_mm, files in by_radius.items():
        project.import_files("balls", files, radius_mm=radius_mm)
