"""The table of all stability cases with the required results."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.simulation.design_parts import LedDesign
from gelpolight_core.simulation.indenters import BallIndenter, CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies import extreme_presses as presses

from .exact_sensor import matt_design
from .extreme_presses import RIGHT_UM, pressed
from .image_case_helpers import BALL, SCALE
from .stability import Case, CaseMeasurement, cases_of

CaseRun = Callable[[], CaseMeasurement]
HEIGHT_MM = 13.7
"""Height of the LEDs, as in the default design."""
GOOD_CONDITION = 7.0
"""Height over radius of LEDs up to which noise does not count."""
MATT = matt_design(SCALE)
STEEP = matt_design(0.5)
"""Steep walls need small pixels."""


def rows(
    run: Callable[..., CaseMeasurement], extremes: Mapping[str, Any], **how: Any
) -> dict[str, CaseRun]:
    """Return the runs of extremes under their names."""
    return {name: partial(run, extreme, **how) for name, extreme in extremes.items()}


def _design(of: SensorDesign = MATT, **parts: dict[str, Any]) -> SensorDesign:
    """Return a design with other values in its parts."""
    changed = {name: replace(getattr(of, name), **values) for name, values in parts.items()}
    return replace(of, **changed)


def _ring(radius_mm: float, height_mm: float, of: SensorDesign = MATT) -> SensorDesign:
    """Return a design with its LEDs on a ring."""
    angles = [math.radians(60.0 + 120.0 * k) for k in range(3)]
    places = [(radius_mm * math.cos(a), radius_mm * math.sin(a)) for a in angles]
    return replace(of, leds=tuple(LedDesign(x, y, height_mm) for x, y in places))


def _bundle(apart_mm: float) -> CaseRun:
    """Return the run with LEDs near each other."""
    radius_mm = apart_mm / math.sqrt(3.0)
    # Noise grows with the condition number, which is about height over radius.
    bound_um = RIGHT_UM * max(1.0, HEIGHT_MM / radius_mm / GOOD_CONDITION)
    return partial(pressed, _ring(radius_mm, HEIGHT_MM), bound_um=bound_um, noisy=True)


def _in_a_row(degrees: float) -> SensorDesign:
    """Return a design with its LEDs nearly on a line."""
    offset_mm = 8.0 * math.tan(math.radians(degrees))
    places = ((-8.0, offset_mm), (0.0, 0.0), (8.0, 0.0))
    return replace(MATT, leds=tuple(LedDesign(x, y, HEIGHT_MM) for x, y in places))


def light_terms(of: SensorDesign) -> dict[str, SensorDesign]:
    """Return a design with each term of a real sensor's light, and with all of them."""
    absorption = (0.004, 0.005, 0.009)
    tilts = ((0.08, -0.03), (-0.05, 0.08), (0.02, -0.07))
    tilted = tuple(replace(led, axis_tilt=t) for led, t in zip(of.leds, tilts, strict=True))
    layers = replace(of.layers, elastomer_absorption_per_mm=absorption)
    membrane = replace(of.membrane, stretch_loss=0.12)
    ring = replace(of.ring, lobe_exponent=1.6)
    return {
        "lobe": replace(of, ring=ring),
        "tilted_axes": replace(of, leds=tilted),
        "absorption": replace(of, layers=layers),
        "stretch": replace(of, membrane=membrane),
        "all_terms": replace(of, layers=layers, leds=tilted, ring=ring, membrane=membrane),
    }


def _lens(diameter_mm: float, **camera: Any) -> SensorDesign:
    return _design(camera=camera, membrane={"working_diameter_mm": diameter_mm})


TABLE: dict[tuple[str, str], dict[str, CaseRun]] = {
    ("images", "40 single bad pixels: finite, other points unchanged"): {
        f"pixels_{name}": partial(presses.on_image, partial(presses.bad_pixels, value), needs=needs)
        for name, value, *needs in (
            ("nan", np.nan),
            ("inf", np.inf),
            ("minus_inf", -np.inf),
            ("negative", -1.0),
            ("huge", 3e38, Flag.SATURATED),
            ("denormal", 1e-45),
            ("black", 0.0),
            ("saturated", 1.0, Flag.SATURATED),
        )
    },
    ("images", "bad over 2 mm: missing and flagged, the rest unchanged"): {
        "patch_saturated": partial(presses.patch, 1.0, (0,), Flag.SATURATED),
        "patch_dark": partial(presses.patch, 0.0, (1,), Flag.DARK),
        "patch_two_dark": partial(presses.patch, 0.0, (0, 2), Flag.DARK),
        "patch_all_dark": partial(presses.patch, 0.0, (0, 1, 2), Flag.DARK),
        "patch_nan": partial(presses.patch, np.nan, (0, 1, 2)),
    },
    ("images", "meaningless: finite, and reported as not reliable"): rows(
        presses.on_image,
        {
            "all_black": np.zeros_like,
            "all_white": np.ones_like,
            "all_grey": lambda f: np.full_like(f, 0.5),
            "all_dim": lambda f: np.full_like(f, 0.1),
            "all_nan": lambda f: np.full_like(f, np.nan),
            "all_inf": lambda f: np.full_like(f, np.inf),
            "denormals": lambda f: f * np.float32(1e-40),
            "negated": np.negative,
            "exposure_doubled": lambda f: f * np.float32(2.0),
            "blue_first": lambda f: f[..., ::-1],
            "upside_down": lambda f: f[::-1],
            "only_noise": lambda f: np.random.default_rng(0).random(f.shape).astype("f4"),
            "floats_of_0_to_255": lambda f: f * np.float32(255.0),
            "12_bits_in_16_bits": lambda f: (f * 4095.0).astype(np.uint16),
        },
        bound_um=-math.inf,  # nothing is right
        radius_mm=12.0,
    ),
    ("images", "other light: measured, corrected and accurate"): rows(
        presses.on_image,
        {
            "light_2_percent": lambda f: f * np.float32(1.02),
            "light_10_percent_weaker": lambda f: f * np.float32(0.9),
            "exposure_halved": lambda f: f * np.float32(0.5),
            "red_2_percent": lambda f: f * np.array([1.02, 1.0, 1.0], np.float32),
        },
    ),
    ("images", "next to nothing: no dent deeper than the slope of a pixel"): {
        "contact_of_a_pixel": partial(
            pressed, MATT, BallIndenter(0.15, 0.03), (0.3, 0.2), bound_um=2.0, radius_mm=3.0
        ),
        "no_contact": partial(pressed, MATT, BallIndenter(4.0, 0.0), (0.3, 0.2), bound_um=0.1),
        "one_bright_pixel": presses.one_bright_pixel,
    },
    ("leds", "8 bits and noise: correct, or refused with the condition number"): {
        **{f"leds_{mm:g}_mm_apart": _bundle(mm) for mm in (0.5, 1.0, 2.0, 4.0, 8.0)},
        **rows(
            pressed,
            {f"leds_{angle:g}_deg_off_a_row": _in_a_row(angle) for angle in (0.0, 2.0, 10.0)},
            bound_um=4.0 * RIGHT_UM,
            noisy=True,
        ),
    },
    ("leds", "0.2 mm pressed: correct, or refused because of too little light"): rows(
        pressed,
        {
            f"leds_{mm:g}_mm_below": _ring(7.0, mm, _design(membrane={"working_diameter_mm": 9.0}))
            for mm in (0.05, 0.5, 1.0, 2.0, 4.0)
        },
        shape=BallIndenter(4.0, 0.2),
        at_mm=(0.3, 0.2),
    ),
    ("light", "correct, also the paper's model, which has no such terms"): rows(
        pressed, {f"light_{name}": design for name, design in light_terms(MATT).items()}
    ),
    ("layers", "correct"): rows(
        pressed,
        {
            **{
                f"index_{n:g}": _design(layers={"elastomer_refractive_index": n})
                for n in (1.0, 1.2, 1.41, 2.0, 2.5)
            },
            **{
                f"slab_{slab:g}_mm": _design(
                    layers={"elastomer_thickness_mm": slab, "top_distance_mm": top}
                )
                for slab, top in ((0.5, 39.0), (5.0, 39.0), (30.0, 60.0), (60.0, 90.0))
            },
            "window_25_mm": _design(
                layers={"elastomer_thickness_mm": 5.0, "window_thickness_mm": 25.0}
            ),
            **{f"tilt_{tilt:g}_deg": _design(layers={"tilt_deg": tilt}) for tilt in (10.0, 20.0)},
        },
    ),
    ("layers", "refused"): rows(
        pressed,
        {
            "total_reflection": _design(layers={"elastomer_refractive_index": 0.9}),
            "slab_reaches_camera": _design(layers={"elastomer_thickness_mm": 40.0}),
        },
    ),
    ("lens", "correct, and the inverse projection agrees"): rows(
        presses.through_lens,
        {
            f"rays_up_to_{edge}_deg": _lens(100.0, fx=px, fy=px, distortion=(0.0, 0.0, 0.0, 0.0))
            for edge, px in ((47, 150.0), (63, 80.0), (76, 40.0))
        },
    ),
    ("lens", "correct where the lens model is one to one, outside elsewhere"): rows(
        presses.through_lens,
        {
            f"distortion_{k1:g}": _lens(60.0, distortion=(k1, 0.0, 0.0, 0.0))
            for k1 in (-0.3, -0.6, -0.9, 0.9)
        },
    ),
    ("walls", "1 mm high: correct, or the map reports that walls may be too low"): {
        **rows(
            pressed,
            {
                f"wall_{degrees}_deg": _design(STEEP, membrane={"decay_length_mm": decay_mm})
                for degrees, decay_mm in ((57, 0.7), (71, 0.35), (76, 0.25), (80, 0.18), (84, 0.1))
            },
            shape=CylinderIndenter(5.0, 1.0),
            at_mm=(0.5, 0.3),
        ),
        **{f"cone_{angle}_deg": partial(presses.cone, STEEP, angle) for angle in (60, 75, 85, 89)},
    },
    ("walls", "correct, or damped and stopped with a note"): {
        "depth_4_mm": partial(pressed, MATT, BallIndenter(6.0, 4.0), bound_um=40.0),
        "depth_8_mm": partial(pressed, MATT, BallIndenter(8.0, 8.0), bound_um=80.0),
        "depth_12_mm": partial(pressed, MATT, BallIndenter(8.0, 12.0), bound_um=120.0),
        "ball_as_wide_as_the_field": partial(
            pressed, MATT, BallIndenter(60.0, 1.4), (0.0, 0.0), bound_um=15.0
        ),
        "plate_larger_than_the_field": partial(
            pressed, MATT, CylinderIndenter(30.0, 1.0), (0.0, 0.0), bound_um=15.0
        ),
        "ball_across_the_rim": partial(pressed, MATT, BALL, (11.0, 0.0)),
        "2_mm_deep_among_leds_at_3_mm": partial(pressed, _ring(3.0, 3.0), BallIndenter(6.0, 2.0)),
    },
}


def all_cases() -> tuple[Case, ...]:
    """Return the cases of all subjects, in the order of the table."""
    return cases_of(TABLE)
