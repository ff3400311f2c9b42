"""The design of a sensor: all decisions of its maker, and the input of the virtual sensor.

A design is written in Python or read from a TOML file; every unknown key is reported, nothing is
guessed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from gelpolight_core.base.codec import pack, unpack_toml
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.limits import Words
from gelpolight_core.base.safe_reading import NAME_LIMIT, read_toml
from gelpolight_core.image.image_file import MAX_PIXELS

from .design_parts import (
    BallPressDesign,
    CameraDesign,
    LayerDesign,
    LedDesign,
    LedRing,
    MembraneDesign,
    PhotometryDesign,
    PressDesign,
    SessionDesign,
)

_THREE_LEDS = (
    LedDesign(x_mm=5.3, y_mm=10.7, height_mm=13.65, power=1.0),
    LedDesign(x_mm=-12.0, y_mm=-0.6, height_mm=13.78, power=0.9),
    LedDesign(x_mm=6.4, y_mm=-10.2, height_mm=13.82, power=1.1),
)
# Spread over the working circle, so that every light's cosine covers its whole range.
_TEN_BALLS = (
    BallPressDesign(3.0, 1.05, -4.1, -1.6),
    BallPressDesign(4.0, 1.15, 0.2, 1.2),
    BallPressDesign(3.0, 0.85, -2.1, -6.2),
    BallPressDesign(4.0, 1.35, 2.3, -3.4),
    BallPressDesign(3.0, 1.10, -1.0, 5.6),
    BallPressDesign(4.0, 0.90, 5.8, 1.9),
    BallPressDesign(3.0, 0.95, -6.4, 3.1),
    BallPressDesign(4.0, 1.20, 4.2, 5.3),
    BallPressDesign(3.0, 1.00, 6.3, -4.6),
    BallPressDesign(4.0, 1.10, -5.2, -5.0),
)
_EIGHT_PRESSES = (
    PressDesign("cylinder", 5.0, 0.5, -2.4, 2.0),
    PressDesign("cylinder", 5.0, 1.0, 3.6, -2.2),
    PressDesign("cylinder", 4.0, 1.5, 1.2, 4.1),
    PressDesign("cuboid", 4.0, 1.0, -3.5, -3.0, 17.0),
    PressDesign("cuboid", 6.0, 1.0, 2.0, 1.5, -32.0),
    PressDesign("cuboid", 5.0, 1.25, -1.5, -1.0, 41.0),
    PressDesign("coin", 8.0, 0.6, -1.0, -1.2, 10.0),
    PressDesign("nut", 5.5, 0.8, 2.5, -1.5, 12.0),
)


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

    serial: Annotated[str, Words(NAME_LIMIT)] = "virtual-1"
    camera: CameraDesign = field(default_factory=CameraDesign)
    layers: LayerDesign = field(default_factory=LayerDesign)
    leds: tuple[LedDesign, ...] = _THREE_LEDS
    ring: LedRing = field(default_factory=LedRing)
    membrane: MembraneDesign = field(default_factory=MembraneDesign)
    photometry: PhotometryDesign = field(default_factory=PhotometryDesign)
    session: SessionDesign = field(default_factory=SessionDesign)
    balls: tuple[BallPressDesign, ...] = _TEN_BALLS
    presses: tuple[PressDesign, ...] = _EIGHT_PRESSES

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
    unpack_toml(SensorDesign, pack(design, {}, ""), where)
    camera, layers, membrane = design.camera, design.layers, design.membrane
    thick_mm = layers.elastomer_thickness_mm + layers.window_thickness_mm
    size = f"{camera.width_px} x {camera.height_px}"
    for is_wrong, table, text in (
        (
            len(design.leds) != 3,
            "[[leds]]",
            f"There are {len(design.leds)} LEDs, not one of each colour",
        ),
        (
            layers.air_gap_mm <= 0.0,
            "[layers]",
            f"The layers are {thick_mm} mm thick, more than top_distance_mm",
        ),
        (
            membrane.apex_height_mm > membrane.working_diameter_mm / 3.0,
            "[membrane]",
            f"apex_height_mm is {membrane.apex_height_mm}, more than a third of the diameter",
        ),
        (
            camera.width_px * camera.height_px > MAX_PIXELS,
            "[camera]",
            f"The camera has {size} pixels, more than {MAX_PIXELS // 10**6} megapixels",
        ),
    ):
        if is_wrong:
            raise InputError(text, f"{where} {table}", Remedy.CORRECT_VALUE)
    return design


def read_design(path: Path) -> SensorDesign:
    """Read a design file over the values of the default sensor.

    The tables are ``[camera]``, ``[layers]``, ``[ring]``, ``[membrane]``, ``[photometry]``,
    ``[session]``, and the lists ``[[leds]]``, ``[[balls]]``, ``[[presses]]``; their keys are the
    attributes of the classes in :mod:`gelpolight_core.simulation.design_parts`.

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
    return validate_design(unpack_toml(SensorDesign, read_toml(path), path), where=str(path))
