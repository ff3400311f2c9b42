"""The design of a sensor: all decisions of its maker, and the input of the virtual sensor.

A design is written in Python or read from a TOML file; every unknown key is reported, nothing is
guessed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.design.parts import (
    BallPress,
    CameraDesign,
    LayerDesign,
    LedDesign,
    LedRing,
    MembraneDesign,
    PhotometryDesign,
    Press,
    SessionDesign,
)
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.image.file import MAX_PIXELS
from gelpolight_core.io.reading import (
    NAME_LIMIT,
    brief,
    plain_text,
    read_toml,
)

_THREE_LEDS = (
    LedDesign(x_mm=5.3, y_mm=10.7, height_mm=13.65, power=1.0),
    LedDesign(x_mm=-12.0, y_mm=-0.6, height_mm=13.78, power=0.9),
    LedDesign(x_mm=6.4, y_mm=-10.2, height_mm=13.82, power=1.1),
)
# Spread over the working circle, so that every light's cosine covers its whole range.
_TEN_BALLS = (
    BallPress(3.0, 1.05, -4.1, -1.6),
    BallPress(4.0, 1.15, 0.2, 1.2),
    BallPress(3.0, 0.85, -2.1, -6.2),
    BallPress(4.0, 1.35, 2.3, -3.4),
    BallPress(3.0, 1.10, -1.0, 5.6),
    BallPress(4.0, 0.90, 5.8, 1.9),
    BallPress(3.0, 0.95, -6.4, 3.1),
    BallPress(4.0, 1.20, 4.2, 5.3),
    BallPress(3.0, 1.00, 6.3, -4.6),
    BallPress(4.0, 1.10, -5.2, -5.0),
)
_EIGHT_PRESSES = (
    Press("cylinder", 5.0, 0.5, -2.4, 2.0),
    Press("cylinder", 5.0, 1.0, 3.6, -2.2),
    Press("cylinder", 4.0, 1.5, 1.2, 4.1),
    Press("cuboid", 4.0, 1.0, -3.5, -3.0, 17.0),
    Press("cuboid", 6.0, 1.0, 2.0, 1.5, -32.0),
    Press("cuboid", 5.0, 1.25, -1.5, -1.0, 41.0),
    Press("coin", 8.0, 0.6, -1.0, -1.2, 10.0),
    Press("nut", 5.5, 0.8, 2.5, -1.5, 12.0),
)


# No number of a sensor has more digits; larger ones overflow.
MOST = 10**15


@dataclass(frozen=True, slots=True)
class SensorDesign:
    """A whole sensor with the objects of its calibration session.

    Attributes
    ----------
    serial : str
        Name of the sensor.
    camera, layers, leds, ring, membrane, photometry
        The parts; `leds` are the red, the green and the blue one.
    session
        Optional stages of a simulated session.
    balls, presses
        What is pressed into it when a session is simulated.

    Examples
    --------
    >>> import gelpolight_core as gp
    >>> small = gp.SensorDesign().scaled(0.25)
    >>> small.camera.width_px, len(small.leds)
    (320, 3)
    """

    serial: str = "virtual-1"
    camera: CameraDesign = field(default_factory=CameraDesign)
    layers: LayerDesign = field(default_factory=LayerDesign)
    leds: tuple[LedDesign, ...] = _THREE_LEDS
    ring: LedRing = field(default_factory=LedRing)
    membrane: MembraneDesign = field(default_factory=MembraneDesign)
    photometry: PhotometryDesign = field(default_factory=PhotometryDesign)
    session: SessionDesign = field(default_factory=SessionDesign)
    balls: tuple[BallPress, ...] = _TEN_BALLS
    presses: tuple[Press, ...] = _EIGHT_PRESSES

    def scaled(self, scale: float) -> SensorDesign:
        """Return the same sensor with a camera of `scale` times as many pixels per side."""
        old = self.camera
        camera = replace(
            old,
            width_px=max(16, round(old.width_px * scale)),
            height_px=max(16, round(old.height_px * scale)),
            fx=old.fx * scale,
            fy=old.fy * scale,
            # Pixel centres have integer coordinates, so the corner of the image is at -0.5.
            cx=(old.cx + 0.5) * scale - 0.5,
            cy=(old.cy + 0.5) * scale - 0.5,
        )
        return replace(self, camera=camera)


def validate_design(design: SensorDesign, *, where: str = "design") -> SensorDesign:
    """Check every number of a design against its range, and the parts against each other.

    Parameters
    ----------
    design : SensorDesign
        The design to check.
    where : str, optional
        File or origin named in the error.

    Returns
    -------
    SensorDesign
        The same design.

    Raises
    ------
    InputError
        If a number is not finite or out of its range, or the parts do not fit together.
    """
    _check_ranges(design, where=where, prefix="")
    if len(design.leds) != 3:
        raise InputError(
            f"There are {len(design.leds)} LEDs, not one of each colour",
            f"{where} [[leds]]",
            Remedy.CORRECT_ENTRY,
        )
    if design.layers.air_gap_mm <= 0.0:
        raise InputError(
            (
                "The layers are "
                f"{design.layers.elastomer_thickness_mm + design.layers.window_thickness_mm} "
                "mm thick, more than top_distance_mm"
            ),
            f"{where} [layers]",
            Remedy.CORRECT_VALUE,
        )
    if design.membrane.apex_height_mm > design.membrane.working_diameter_mm / 3.0:
        raise InputError(
            (
                f"The membrane's apex is {design.membrane.apex_height_mm} "
                "mm high, more than a third of its diameter"
            ),
            f"{where} [membrane]",
            Remedy.CORRECT_VALUE,
        )
    if design.camera.width_px * design.camera.height_px > MAX_PIXELS:
        raise InputError(
            (
                f"The camera has {design.camera.width_px} x {design.camera.height_px} "
                f"pixels, more than {MAX_PIXELS // 10**6} megapixels"
            ),
            f"{where} [camera]",
            Remedy.CORRECT_VALUE,
        )
    return design


def _check_ranges(part: Any, *, where: str, prefix: str) -> None:
    for item in fields(part):
        value = getattr(part, item.name)
        name = f"{prefix}{item.name}"
        if "low" in item.metadata:
            low, high = item.metadata["low"], item.metadata["high"]
            numbers = np.asarray(value, dtype=np.float64)
            # A comparison with NaN is false, so NaN is refused too.
            if not np.all((numbers >= low) & (numbers <= high)):
                raise InputError(
                    f"{name} is {brief(value)}, not a number from {low} to {high}",
                    where,
                    Remedy.CORRECT_VALUE,
                )
        elif "choices" in item.metadata:
            choices = item.metadata["choices"]
            if value not in choices:
                raise InputError(
                    f"{name} is {brief(value)}",
                    where,
                    Remedy.ONE_OF.format(names=", ".join(map(str, choices))),
                )
        elif hasattr(value, "__dataclass_fields__"):
            _check_ranges(value, where=where, prefix=f"{name}.")
        elif isinstance(value, tuple):
            for number, entry in enumerate(value):
                _check_ranges(entry, where=where, prefix=f"{name}[{number}].")


def read_design(path: Path) -> SensorDesign:
    """Read a design file; missing values keep those of the default sensor.

    The tables are ``[camera]``, ``[layers]``, ``[ring]``, ``[membrane]``, ``[photometry]``,
    ``[session]``, and the lists ``[[leds]]``, ``[[balls]]``, ``[[presses]]``; their keys are the
    attributes of the classes in :mod:`gelpolight_core.design.parts`.

    Parameters
    ----------
    path : Path
        TOML file.

    Returns
    -------
    SensorDesign
        Checked.

    Raises
    ------
    InputError
        If the file is missing, is not TOML, has an unknown key, or a value of the wrong type or out
        of range.
    """
    path = Path(path)
    design: SensorDesign = _read(SensorDesign(), read_toml(path), where=str(path), part="")
    return validate_design(design, where=str(path))


def _read(default: Any, table: Any, *, where: str, part: str) -> Any:
    """Return a part of a design with the values of a table instead of its defaults."""
    where = f"{where} [{part}]" if part else where
    if not isinstance(table, dict):
        raise InputError("The value is not a table", where, Remedy.CORRECT_ENTRY)
    known = {item.name for item in fields(default)}
    if unknown := sorted(set(table) - known):
        raise InputError(
            "Unknown key {keys}".format(keys=brief(", ".join(unknown), 200)),
            where,
            Remedy.ONE_OF.format(names=", ".join(sorted(known))),
        )
    values = {}
    for name, value in table.items():
        like = getattr(default, name)
        if is_dataclass(like):
            values[name] = _read(like, value, where=where, part=name)
        elif isinstance(like, tuple) and is_dataclass(like[0]):
            if not isinstance(value, list):
                raise InputError(
                    "The value is not a list of tables (double brackets)",
                    f"{where} [[{name}]]",
                    Remedy.CORRECT_ENTRY,
                )
            kind: Any = type(like[0])
            values[name] = tuple(_read(kind(), v, where=where, part=f"[{name}]") for v in value)
        else:
            values[name] = _converted(value, like, where=f"{where} {name}")
    return replace(default, **values)


def _is_plain(text: str) -> bool:
    try:
        return bool(plain_text(text, NAME_LIMIT))
    except ValueError:
        return False


def _converted(value: Any, like: Any, *, where: str) -> Any:
    """Return `value` with the type and layout of the default `like`."""
    if isinstance(like, tuple):
        if isinstance(value, list) and len(value) == len(like):
            pairs = zip(value, like, strict=True)
            return tuple(_converted(v, x, where=where) for v, x in pairs)
        kind = f"a list of {len(like)}"
    elif isinstance(like, str):
        if isinstance(value, str) and _is_plain(value):
            return value
        kind = "plain text"
    elif isinstance(like, bool):
        if isinstance(value, bool):
            return value
        kind = "true or false"
    elif isinstance(like, int):
        if isinstance(value, int) and not isinstance(value, bool) and abs(value) < MOST:
            return value
        kind = "a whole number"
    else:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value) if abs(value) < MOST else math.inf
        kind = "a number"
    raise InputError(
        f"The value is {brief(value)}, not {kind}",
        where,
        Remedy.CORRECT_VALUE,
    )
