"""Extreme images: values that no camera delivers, and all number types of image files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import Ball
from gelpolight_core.studies.stability import Case, Mode, Seen, group, seen_once
from gelpolight_core.studies.trial import (
    condition_of,
    depth_error,
    flag_shares,
    is_finite,
    judged,
    maps_of,
    rms_um,
    standard_press,
    standard_sensor,
    warnings_of,
)

Map = NDArray[np.float32]
Change = Callable[[Map], NDArray[Any]]
BAD_PIXELS = 40
SPOILT_UM = 8.0
"""Of 40 bad pixels, a twentieth of a per cent, on a press of 1 mm."""
HIDDEN_MM = 1.0
BAD_VALUES = {
    "nan": np.nan,
    "inf": np.inf,
    "minus_inf": -np.inf,
    "negative": -1.0,
    "huge": 3e38,
    "denormal": 1e-45,
    "black": 0.0,
    "saturated": 1.0,
}
PATCHES: dict[str, tuple[float, tuple[int, ...], Flag | None]] = {
    "patch_saturated": (1.0, (0,), Flag.SATURATED),
    "patch_dark": (0.0, (1,), Flag.DARK),
    "patch_two_dark": (0.0, (0, 2), Flag.DARK),
    "patch_all_dark": (0.0, (0, 1, 2), Flag.DARK),
    "patch_nan": (np.nan, (0, 1, 2), None),
}
"""Value, channels and expected flag of a patch of 2 mm."""
MEANINGLESS: dict[str, Change] = {
    "all_black": np.zeros_like,
    "all_white": np.ones_like,
    "all_grey": lambda f: np.full_like(f, 0.5),
    "all_dim": lambda f: np.full_like(f, 0.1),
    "all_nan": lambda f: np.full_like(f, np.nan),
    "all_inf": lambda f: np.full_like(f, np.inf),
    "denormals": lambda f: f * np.float32(1e-40),
    "negated": np.negative,
    "exposure_doubled": lambda f: f * np.float32(2.0),
    "exposure_halved": lambda f: f * np.float32(0.5),
    "light_10_percent_weaker": lambda f: f * np.float32(0.9),
    "blue_first": lambda f: f[..., ::-1],
    "upside_down": lambda f: f[::-1],
    "only_noise": lambda f: np.random.default_rng(0).random(f.shape).astype("f4"),
    "floats_of_0_to_255": lambda f: f * np.float32(255.0),
    "12_bits_in_16_bits": lambda f: (f * 4095.0).astype(np.uint16),
}
OTHER_LIGHT: dict[str, Change] = {
    "light_2_percent": lambda f: f * np.float32(1.02),
    "red_2_percent": lambda f: f * np.array([1.02, 1.0, 1.0], np.float32),
}
KINDS: dict[str, Change] = {
    "uint8": lambda f: np.rint(f * 255).astype(np.uint8),
    "uint16": lambda f: np.rint(f * 65535).astype(np.uint16),
    "uint16_other_byte_order": lambda f: np.rint(f * 65535).astype(">u2"),
    "float16": lambda f: f.astype(np.float16),
    "float32_other_byte_order": lambda f: f.astype(">f4"),
    "float64": lambda f: f.astype(np.float64),
    "int8": lambda f: (f * 127).astype(np.int8),
    "int32": lambda f: (f * 255).astype(np.int32),
    "bool": lambda f: f > 0.3,
    "complex": lambda f: f.astype(np.complex128),
    "text": lambda f: f.astype(np.str_),
    "grey": lambda f: f[..., 0],
    "four_channels": lambda f: np.concatenate([f, f[..., :1]], axis=-1),
    "empty": lambda f: f[:0],
    "one_row": lambda f: f[:1],
    "one_column": lambda f: f[:, :1],
    "strided": lambda f: np.repeat(f, 2, axis=1)[:, ::2],
    "turned_in_memory": np.asfortranarray,
    "read_only": lambda f: np.frombuffer(f.tobytes(), f.dtype).reshape(f.shape),
}


def image_cases() -> list[Case]:
    """Return the cases on images."""
    bad = {f"pixels_{name}": partial(_bad_pixels, value) for name, value in BAD_VALUES.items()}
    patches = {name: partial(_patch, *how) for name, how in PATCHES.items()}
    meaningless = {name: partial(_meaningless, make) for name, make in MEANINGLESS.items()}
    light = {name: partial(_other_light, make) for name, make in OTHER_LIGHT.items()}
    kinds = {f"kind_{kind}": partial(_kind, make) for kind, make in KINDS.items()}
    contacts: dict[str, Callable[[], Seen]] = {
        "contact_of_a_pixel": partial(_ball, Ball(0.15, 0.03), 2.0, radius_mm=3.0),
        "no_contact": partial(_ball, Ball(4.0, 0.0), 0.1),
        "one_bright_pixel": _one_bright_pixel,
    }
    return [
        *group("images", "40 single bad pixels: finite, other points unchanged", bad),
        *group("images", "bad over 2 mm: missing and flagged, the rest unchanged", patches),
        *group("images", "meaningless: finite, and reported as not reliable", meaningless),
        *group("images", "other light: measured, corrected and accurate", light),
        *group("images", "a number type: the same depth, or an error that names it", kinds),
        *group("images", "next to nothing: no dent deeper than the slope of a pixel", contacts),
    ]


def _bad_pixels(value: float) -> Seen:
    frame = standard_press().frame.copy()
    rng = np.random.default_rng(0)
    rows, columns = (rng.integers(20, n - 20, BAD_PIXELS) for n in frame.shape[:2])
    frame[rows, columns] = value
    needs = (Flag.SATURATED,) if value in (1.0, 3e38) else ()
    return judged(standard_sensor(), standard_press(), SPOILT_UM, frame=frame, needs=needs)


def _patch(value: float, channels: tuple[int, ...], flag: Flag | None) -> Seen:
    known, press = standard_sensor(), standard_press()
    table = known.calibration.table
    x, y = np.meshgrid(table.grid.x_mm, table.grid.y_mm)
    away_mm = np.hypot(x + 6.0, y - 1.0)
    hidden = away_mm < HIDDEN_MM
    frame = press.frame.copy()
    rows, columns = (np.rint(m[hidden]).astype(int) for m in (table.v_px, table.u_px))
    for channel in channels:
        frame[rows, columns, channel] = value
    # Two lights over a wide patch are sufficient; one or none is not.
    bound = SPOILT_UM if len(channels) == 1 else 2.0 * SPOILT_UM
    needs = () if flag is None else (flag,)
    wider = away_mm < HIDDEN_MM + 0.3
    return judged(known, press, bound, frame=frame, spare=wider, needs=needs)


def _meaningless(make: Change) -> Seen:
    """Reconstruct an impossible image; each mode must report it."""
    known, press = standard_sensor(), standard_press()
    maps = maps_of(known.calibration, make(press.frame))
    modes = []
    for name, found in maps.items():
        error = rms_um(depth_error(found, press.truth, radius_mm=12.0))
        warning = "; ".join(warnings_of(found)[:1]) if is_finite(found) else ""
        modes.append(Mode(name, False, error, warning=warning))
    summary = f"{modes[0].error_um:.0f} um RMS"
    return Seen(summary, tuple(modes), flag_shares(maps["best"]), condition_of(known.calibration))


def _other_light(make: Change) -> Seen:
    press = standard_press()
    return judged(standard_sensor(), press, SPOILT_UM, frame=make(press.frame))


def _kind(make: Change) -> Seen:
    """Reconstruct other number types, which must give the usual depth."""
    known, press = standard_sensor(), standard_press()
    frame = make(press.frame)
    # Effect of the skipped field beside a contact, root mean square.
    seen = judged(known, press, 2.0, frame=frame)
    solver = Reconstructor(known.calibration)
    apart = solver.depth(frame).depth_mm - solver.depth(press.frame).depth_mm
    apart_um = rms_um(apart.astype(np.float64))
    modes = tuple(replace(mode, right=mode.right and apart_um < 1.0) for mode in seen.modes)
    summary = f"{seen.summary}; {apart_um:.2f} um from the usual number type"
    return replace(seen, summary=summary, modes=modes)


def _ball(ball: Ball, bound_um: float, *, radius_mm: float | None = None) -> Seen:
    press = standard_sensor().pressed(ball, x_mm=0.3, y_mm=0.2)
    return judged(standard_sensor(), press, bound_um, radius_mm=radius_mm)


def _one_bright_pixel() -> Seen:
    frame = standard_sensor().bare()
    frame[frame.shape[0] // 2, frame.shape[1] // 2] *= 1.3
    found = Reconstructor(standard_sensor().calibration).depth(frame)
    deepest = float(np.abs(found.depth_mm).max())
    summary = f"at most {1e3 * deepest:.1f} um deep beside {1e3 * found.pitch_mm:.0f} um of a pixel"
    return seen_once(is_finite(found) and deepest < found.pitch_mm, summary)
