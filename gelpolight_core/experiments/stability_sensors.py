"""Extreme sensors and presses: unusual LEDs, layers and lenses; deep presses, steep walls."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from gelpolight_core.design.parts import LayerDesign, LedDesign
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.known_sensor import known_sensor, matt_design
from gelpolight_core.experiments.stability import Case, Seen
from gelpolight_core.experiments.stability_trial import (
    BALL,
    BALL_AT_MM,
    SCALE,
    judged,
    standard_sensor,
)
from gelpolight_core.optics.refraction import camera_to_membrane
from gelpolight_core.simulation.indenters import Ball, Cylinder, Indenter
from gelpolight_core.simulation.surface import PressedSurface
from gelpolight_core.translation import tr

LEDS, LAYERS, LENSES, WALLS = "leds", "layers", "lens", "walls"
FINE = 0.5
RIGHT_UM = 10.0
"""One per cent of a press of 1 mm."""
CONE_PITCH_MM = 0.01
RING_DEG = (60.0, 180.0, 300.0)


def sensor_cases() -> tuple[Case, ...]:
    """Return the cases on LEDs, layers, lenses and steep or deep presses."""
    return (*_led_cases(), *_layer_cases(), *_lens_cases(), *_wall_cases(), *_deep_cases())


def _ring(radius_mm: float, height_mm: float) -> tuple[LedDesign, ...]:
    return tuple(
        LedDesign(
            radius_mm * math.cos(math.radians(a)), radius_mm * math.sin(math.radians(a)), height_mm
        )
        for a in RING_DEG
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
    right_or_refused = tr("correct, or refused with the condition number")
    cases = []
    for apart_mm in (0.5, 1.0, 2.0, 4.0, 8.0):
        radius = apart_mm / math.sqrt(3.0)
        # Noise grows with the condition number: 1 % of the press for each 10 of it.
        bound = RIGHT_UM * max(1.0, 13.7 / radius / 7.0)
        cases.append(
            Case(
                f"leds_{apart_mm:g}_mm_apart",
                LEDS,
                tr("three LEDs {x:g} mm apart, 8 bits and noise").format(x=apart_mm),
                right_or_refused,
                partial(
                    _pressed, replace(matt, leds=_ring(radius, 13.7)), bound_um=bound, noisy=True
                ),
            )
        )
    for degrees in (0.0, 2.0, 10.0):
        row = (LedDesign(-8.0, 8.0 * math.tan(math.radians(degrees)), 13.7), *_row()[1:])
        cases.append(
            Case(
                f"leds_in_a_row_{degrees:g}_deg",
                LEDS,
                tr("three LEDs in a row, {x:g} degrees off it").format(x=degrees),
                right_or_refused,
                partial(_pressed, replace(matt, leds=row), noisy=True, bound_um=4 * RIGHT_UM),
            )
        )
    small = replace(matt, membrane=replace(matt.membrane, working_diameter_mm=9.0))
    shallow = Ball(4.0, 0.2)
    for height_mm in (0.05, 0.5, 1.0, 2.0, 4.0):
        cases.append(
            Case(
                f"leds_{height_mm:g}_mm_below",
                LEDS,
                tr("LEDs {x:g} mm below the membrane plane, 0.2 mm pressed").format(x=height_mm),
                tr("correct, or refused because of too little light"),
                partial(_pressed, replace(small, leds=_ring(7.0, height_mm)), shallow, (0.3, 0.2)),
            )
        )
    return cases


def _row() -> tuple[LedDesign, ...]:
    return tuple(LedDesign(x, 0.0, 13.7) for x in (-8.0, 0.0, 8.0))


def _layer_cases() -> list[Case]:
    matt = matt_design(SCALE)
    required = tr("correct")
    cases = []
    for index in (1.0, 1.2, 1.41, 2.0, 2.5):
        layers = replace(matt.layers, elastomer_refractive_index=index)
        cases.append(
            _layer_case(
                f"index_{index:g}", tr("index {x:g}").format(x=index), matt, layers, required
            )
        )
    below = replace(matt.layers, elastomer_refractive_index=0.9)
    cases.append(
        _layer_case("index_0.9", tr("index 0.9: total reflection"), matt, below, tr("refused"))
    )
    for slab_mm, top_mm in ((0.5, 39.0), (5.0, 39.0), (30.0, 60.0), (60.0, 90.0)):
        layers = replace(
            matt.layers,
            elastomer_thickness_mm=slab_mm,
            top_distance_mm=top_mm,
            window_thickness_mm=0.0,
        )
        label = tr("a slab of {x:g} mm").format(x=slab_mm)
        cases.append(_layer_case(f"slab_{slab_mm:g}_mm", label, matt, layers, required))
    thick = replace(matt.layers, elastomer_thickness_mm=40.0)
    label = tr("a slab thicker than the space in front of the camera")
    cases.append(_layer_case("slab_too_thick", label, matt, thick, tr("refused")))
    window = replace(matt.layers, elastomer_thickness_mm=5.0, window_thickness_mm=25.0)
    cases.append(_layer_case("window_25_mm", tr("a window of 25 mm"), matt, window, required))
    for degrees in (10.0, 20.0):
        label = tr("camera tilted by {x:g} degrees").format(x=degrees)
        tilted = replace(matt.layers, tilt_deg=degrees)
        cases.append(_layer_case(f"tilt_{degrees:g}_deg", label, matt, tilted, required))
    return cases


def _layer_case(
    name: str, label: str, base: SensorDesign, layers: LayerDesign, required: str
) -> Case:
    design = replace(base, layers=layers)
    return Case(name, LAYERS, label, required, partial(_pressed, design))


def _lens_cases() -> list[Case]:
    matt = matt_design(SCALE)
    cases = []
    for focal_px in (150.0, 80.0, 40.0):
        camera = replace(matt.camera, fx=focal_px, fy=focal_px, distortion=(0.0, 0.0, 0.0, 0.0))
        wide = replace(matt.membrane, working_diameter_mm=100.0)
        edge = math.degrees(math.atan(0.5 * camera.width_px / focal_px))
        cases.append(
            Case(
                f"lens_{edge:.0f}_deg",
                LENSES,
                tr("rays up to {x:.0f} degrees").format(x=edge),
                tr("correct, and the inverse projection agrees"),
                partial(_lens, replace(matt, camera=camera, membrane=wide)),
            )
        )
    for k1 in (-0.3, -0.6, -0.9, 0.9):
        camera = replace(matt.camera, distortion=(k1, 0.0, 0.0, 0.0))
        wide = replace(matt.membrane, working_diameter_mm=60.0)
        cases.append(
            Case(
                f"distortion_{k1:g}",
                LENSES,
                tr("lens distortion k1 = {x:g}").format(x=k1),
                tr("correct where the lens model is one to one, and outside elsewhere"),
                partial(_lens, replace(matt, camera=camera, membrane=wide)),
            )
        )
    return cases


def _lens(design: SensorDesign) -> Seen:
    """Press a ball, and project every node to its pixel and back."""
    known = known_sensor(design)
    calibration = known.calibration
    table = calibration.table
    pixels = np.stack([table.u_px, table.v_px], axis=-1)[table.valid].astype(np.float64)
    there, _ = camera_to_membrane(
        calibration.camera.directions(pixels), calibration.plane, calibration.stack
    )
    away_mm = np.hypot(*(there - table.grid.points_mm()[table.valid]).T)
    press = known.pressed(BALL, x_mm=BALL_AT_MM[0], y_mm=BALL_AT_MM[1])
    # A wide-angle lens has large pixels: 3 % of a pixel if that is more.
    bound_um = max(RIGHT_UM, 30.0 * table.grid.pitch_mm)
    seen = judged(known, press, bound_um, radius_mm=7.0)
    worst = float(away_mm.max())
    text = tr("{summary}; forward and back within {d:.2g} mm")
    summary = text.format(summary=seen.summary, d=worst)
    # Pixels are kept in single precision: some thousandths of a pixel.
    return replace(seen, summary=summary, right=seen.right and worst < 0.02 * table.grid.pitch_mm)


def _wall_cases() -> list[Case]:
    required = tr("correct, or the map reports that features on walls may be too low")
    cases = []
    matt = matt_design(FINE)
    for degrees, decay_mm in ((57, 0.7), (71, 0.35), (76, 0.25), (80, 0.18), (84, 0.1)):
        design = replace(matt, membrane=replace(matt.membrane, decay_length_mm=decay_mm))
        cases.append(
            Case(
                f"wall_{degrees}_deg",
                WALLS,
                tr("a cylinder of 1 mm with walls of {x} degrees").format(x=degrees),
                required,
                partial(_pressed, design, Cylinder(5.0, 1.0), (0.5, 0.3)),
                quick=False,
            )
        )
    for degrees in (60, 75, 85, 89):
        cases.append(
            Case(
                f"cone_{degrees}_deg",
                WALLS,
                tr("a frustum of 1 mm with flanks of {x} degrees and sharp edges").format(
                    x=degrees
                ),
                required,
                partial(_cone, float(degrees)),
                quick=False,
            )
        )
    return cases


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
    low = replace(matt_design(SCALE), leds=_ring(3.0, 3.0))
    summary = tr("correct, or damped and stopped with a note")
    entries: list[tuple[str, str, Indenter, tuple[float, float], float]] = [
        ("depth_4_mm", tr("4 mm deep, LEDs at 13.7 mm"), Ball(6.0, 4.0), (1.2, -0.8), 40.0),
        ("depth_8_mm", tr("8 mm deep, LEDs at 13.7 mm"), Ball(8.0, 8.0), (1.2, -0.8), 80.0),
        ("depth_12_mm", tr("12 mm deep, LEDs at 13.7 mm"), Ball(8.0, 12.0), (1.2, -0.8), 120.0),
        ("ball_of_the_field", tr("a ball as wide as the field"), Ball(60.0, 1.4), (0, 0), 15.0),
        (
            "beyond_the_field",
            tr("a plate larger than the field"),
            Cylinder(30.0, 1.0),
            (0, 0),
            15.0,
        ),
        ("across_the_rim", tr("a ball across the boundary"), BALL, (11.0, 0.0), RIGHT_UM),
    ]
    cases = [
        Case(name, WALLS, label, summary, partial(_in_standard, indenter, at_mm, bound))
        for name, label, indenter, at_mm, bound in entries
    ]
    cases.append(
        Case(
            "among_the_leds",
            WALLS,
            tr("2 mm deep among LEDs at 3 mm"),
            summary,
            partial(_pressed, low, Ball(6.0, 2.0)),
        )
    )
    return cases


def _in_standard(indenter: Indenter, at_mm: tuple[float, float], bound_um: float) -> Seen:
    known = standard_sensor()
    press = known.pressed(indenter, x_mm=at_mm[0], y_mm=at_mm[1])
    return judged(known, press, bound_um)
