"""Extreme sensors and presses: unusual LEDs, layers and lenses; deep presses, steep walls."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gelpolight_core.design.parts import LedDesign
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.optics.refraction import camera_to_membrane
from gelpolight_core.simulation.indenters import Ball, Cylinder, Indenter
from gelpolight_core.simulation.surface import PressedSurface
from gelpolight_core.studies.known_sensor import known_sensor, matt_design
from gelpolight_core.studies.stability import Case, Seen, group
from gelpolight_core.studies.trial import BALL, BALL_AT_MM, SCALE, judged

FINE = 0.5
"""Image size for steep walls, which need small pixels."""
RIGHT_UM = 10.0
"""One per cent of a press of 1 mm."""
HEIGHT_MM = 13.7
"""Of the LEDs, as in the default design."""
GOOD_CONDITION = 7.0
"""Height over radius of LEDs up to which noise does not count."""
CONE_PITCH_MM = 0.01
LAYERS: dict[str, dict[str, float]] = {
    **{f"index_{n:g}": {"elastomer_refractive_index": n} for n in (1.0, 1.2, 1.41, 2.0, 2.5)},
    **{
        f"slab_{slab:g}_mm": {"elastomer_thickness_mm": slab, "top_distance_mm": top}
        for slab, top in ((0.5, 39.0), (5.0, 39.0), (30.0, 60.0), (60.0, 90.0))
    },
    "window_25_mm": {"elastomer_thickness_mm": 5.0, "window_thickness_mm": 25.0},
    "tilt_10_deg": {"tilt_deg": 10.0},
    "tilt_20_deg": {"tilt_deg": 20.0},
}
IMPOSSIBLE_LAYERS = {
    "total_reflection": {"elastomer_refractive_index": 0.9},
    "slab_reaches_camera": {"elastomer_thickness_mm": 40.0},
}
DEEP: dict[str, tuple[Indenter, tuple[float, float], float]] = {
    "depth_4_mm": (Ball(6.0, 4.0), BALL_AT_MM, 40.0),
    "depth_8_mm": (Ball(8.0, 8.0), BALL_AT_MM, 80.0),
    "depth_12_mm": (Ball(8.0, 12.0), BALL_AT_MM, 120.0),
    "ball_as_wide_as_the_field": (Ball(60.0, 1.4), (0.0, 0.0), 15.0),
    "plate_larger_than_the_field": (Cylinder(30.0, 1.0), (0.0, 0.0), 15.0),
    "ball_across_the_rim": (BALL, (11.0, 0.0), RIGHT_UM),
}
"""Indenter, position and accepted error."""


def sensor_cases() -> list[Case]:
    """Return the cases on LEDs, layers, lenses and steep or deep presses."""
    return [*_led_cases(), *_layer_cases(), *_lens_cases(), *_wall_cases(), *_deep_cases()]


def _ring(radius_mm: float, height_mm: float) -> tuple[LedDesign, ...]:
    angles = (math.radians(60.0 + 120.0 * k) for k in range(3))
    return tuple(
        LedDesign(radius_mm * math.cos(a), radius_mm * math.sin(a), height_mm) for a in angles
    )


def _pressed(
    design: SensorDesign,
    indenter: Indenter = BALL,
    at_mm: tuple[float, float] = BALL_AT_MM,
    *,
    bound_um: float = RIGHT_UM,
    noisy: bool = False,
) -> Seen:
    known = known_sensor(design)
    press = known.pressed(indenter, x_mm=at_mm[0], y_mm=at_mm[1])
    frame = known.noisy(press.frame) if noisy else None
    return judged(known, press, bound_um, frame=frame)


def _led_cases() -> list[Case]:
    matt = matt_design(SCALE)
    noisy = partial(_pressed, noisy=True)
    bundles, rows, low = {}, {}, {}
    for apart_mm in (0.5, 1.0, 2.0, 4.0, 8.0):
        radius = apart_mm / math.sqrt(3.0)
        # Noise grows with the condition number, which is about height over radius.
        bound = RIGHT_UM * max(1.0, HEIGHT_MM / radius / GOOD_CONDITION)
        design = replace(matt, leds=_ring(radius, HEIGHT_MM))
        bundles[f"leds_{apart_mm:g}_mm_apart"] = partial(noisy, design, bound_um=bound)
    for degrees in (0.0, 2.0, 10.0):
        away_mm = 8.0 * math.tan(math.radians(degrees))
        positions = ((-8.0, away_mm), (0.0, 0.0), (8.0, 0.0))
        design = replace(matt, leds=tuple(LedDesign(x, y, HEIGHT_MM) for x, y in positions))
        rows[f"leds_{degrees:g}_deg_off_a_row"] = partial(noisy, design, bound_um=4.0 * RIGHT_UM)
    small = replace(matt, membrane=replace(matt.membrane, working_diameter_mm=9.0))
    for height_mm in (0.05, 0.5, 1.0, 2.0, 4.0):
        design = replace(small, leds=_ring(7.0, height_mm))
        shallow = partial(_pressed, design, Ball(4.0, 0.2), (0.3, 0.2))
        low[f"leds_{height_mm:g}_mm_below"] = shallow
    near = "8 bits and noise: correct, or refused with the condition number"
    dim = "0.2 mm pressed: correct, or refused because of too little light"
    return [*group("leds", near, bundles | rows), *group("leds", dim, low)]


def _layer_cases() -> list[Case]:
    matt = matt_design(SCALE)

    def runs(layers: dict[str, Any]) -> dict[str, partial[Seen]]:
        changed = {name: replace(matt.layers, **changes) for name, changes in layers.items()}
        return {name: partial(_pressed, replace(matt, layers=c)) for name, c in changed.items()}

    return [
        *group("layers", "correct", runs(LAYERS)),
        *group("layers", "refused", runs(IMPOSSIBLE_LAYERS)),
    ]


def _lens_cases() -> list[Case]:
    matt = matt_design(SCALE)

    def run(diameter_mm: float, **changes: Any) -> partial[Seen]:
        membrane = replace(matt.membrane, working_diameter_mm=diameter_mm)
        camera = replace(matt.camera, **changes)
        return partial(_lens, replace(matt, camera=camera, membrane=membrane))

    wide = {}
    for focal_px in (150.0, 80.0, 40.0):
        edge = math.degrees(math.atan(0.5 * matt.camera.width_px / focal_px))
        lens = run(100.0, fx=focal_px, fy=focal_px, distortion=(0.0, 0.0, 0.0, 0.0))
        wide[f"rays_up_to_{edge:.0f}_deg"] = lens
    bent = {
        f"distortion_{k1:g}": run(60.0, distortion=(k1, 0.0, 0.0, 0.0))
        for k1 in (-0.3, -0.6, -0.9, 0.9)
    }
    one_to_one = "correct where the lens model is one to one, outside elsewhere"
    return [
        *group("lens", "correct, and the inverse projection agrees", wide),
        *group("lens", one_to_one, bent),
    ]


def _lens(design: SensorDesign) -> Seen:
    """Press a ball, and project every node to its pixel and back."""
    known = known_sensor(design)
    sensor, table = known.calibration.open_sensor, known.calibration.table
    pixels = np.stack([table.u_px, table.v_px], axis=-1)[table.valid].astype(np.float64)
    points, _ = camera_to_membrane(sensor.camera.directions(pixels), sensor.plane, sensor.stack)
    worst_mm = float(np.hypot(*(points - table.grid.points_mm()[table.valid]).T).max())
    press = known.pressed(BALL, x_mm=BALL_AT_MM[0], y_mm=BALL_AT_MM[1])
    # A wide-angle lens has large pixels: 3 % of a pixel if that is more.
    bound_um = max(RIGHT_UM, 30.0 * table.grid.pitch_mm)
    seen = judged(known, press, bound_um, radius_mm=7.0)
    # Pixels are kept in single precision: some thousandths of a pixel.
    agrees = worst_mm < 0.02 * table.grid.pitch_mm
    modes = tuple(mode if agrees else replace(mode, right=False, warning="") for mode in seen.modes)
    summary = f"{seen.summary}; forward and back within {worst_mm:.2g} mm"
    return replace(seen, summary=summary, modes=modes)


def _wall_cases() -> list[Case]:
    matt = matt_design(FINE)
    walls: dict[str, Callable[[], Seen]] = {}
    for degrees, decay_mm in ((57, 0.7), (71, 0.35), (76, 0.25), (80, 0.18), (84, 0.1)):
        design = replace(matt, membrane=replace(matt.membrane, decay_length_mm=decay_mm))
        walls[f"wall_{degrees}_deg"] = partial(_pressed, design, Cylinder(5.0, 1.0), (0.5, 0.3))
    for degrees in (60, 75, 85, 89):
        walls[f"cone_{degrees}_deg"] = partial(_cone, degrees)
    required = "1 mm high: correct, or the map reports that walls may be too low"
    return group("walls", required, walls)


def _cone(degrees: float) -> Seen:
    """Press a frustum that the membrane follows completely, with foot and edge."""
    steps = round(6.0 / CONE_PITCH_MM)
    axis = CONE_PITCH_MM * np.arange(-steps, steps + 1)
    x, y = np.meshgrid(axis, axis)
    flank = (3.0 - np.hypot(x, y)) * math.tan(math.radians(degrees))
    depth = np.clip(flank, 0.0, 1.0)
    surface = PressedSurface(depth, depth > 0.0, float(axis[0]), float(axis[0]), CONE_PITCH_MM)
    known = known_sensor(matt_design(FINE))
    return judged(known, known.showing(surface), RIGHT_UM)


def _deep_cases() -> list[Case]:
    matt = matt_design(SCALE)
    deep = {
        name: partial(_pressed, matt, indenter, at_mm, bound_um=bound_um)
        for name, (indenter, at_mm, bound_um) in DEEP.items()
    }
    low = replace(matt, leds=_ring(3.0, 3.0))
    deep["2_mm_deep_among_leds_at_3_mm"] = partial(_pressed, low, Ball(6.0, 2.0))
    return group("walls", "correct, or damped and stopped with a note", deep)
