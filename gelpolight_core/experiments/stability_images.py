"""Extreme images: values that no camera delivers, and all number types of image files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.experiments.stability import Case, Seen
from gelpolight_core.experiments.stability_trial import (
    BALL_AT_MM,
    condition_of,
    depth_error,
    flag_shares,
    flagged,
    is_finite,
    judged,
    maps_of,
    rms_um,
    standard_press,
    standard_sensor,
    warnings_of,
)
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import MODELS
from gelpolight_core.simulation.indenters import Ball
from gelpolight_core.translation import tr

Map = NDArray[np.float32]
SUBJECT = "images"
BAD_PIXELS = 40
SPOILT_UM = 8.0
"""Of 40 bad pixels, a twentieth of a per cent, on a press of 1 mm."""
SAME_UM = 1.0
BESIDE_UM = 2.0
"""Effect of the skipped field beside a contact, root mean square (docs/speed.md)."""
HIDDEN_MM = 1.0


def image_cases() -> tuple[Case, ...]:
    """Return the cases on images."""
    return (
        *_bad_pixels(),
        *_missing_channels(),
        *_whole_images(),
        *_other_light(),
        *_kinds(),
        *_contacts(),
    )


def _case(name: str, label: str, required: str, run: Callable[[], Seen]) -> Case:
    return Case(name, SUBJECT, label, required, run)


def _bad_pixels() -> list[Case]:
    values = {
        "nan": np.nan,
        "inf": np.inf,
        "minus_inf": -np.inf,
        "negative": -1.0,
        "huge": 3e38,
        "denormal": 1e-45,
        "black": 0.0,
        "saturated": 1.0,
    }
    label = tr("{n} single pixels of value {value:g}")
    required = tr("the map is finite, and its other points are unchanged")
    return [
        _case(
            f"pixels_{name}",
            label.format(n=BAD_PIXELS, value=value),
            required,
            partial(_with_bad_pixels, value),
        )
        for name, value in values.items()
    ]


def _with_bad_pixels(value: float) -> Seen:
    frame = standard_press().frame.copy()
    rng = np.random.default_rng(0)
    rows, columns = (rng.integers(20, n - 20, BAD_PIXELS) for n in frame.shape[:2])
    frame[rows, columns] = value
    needs = (Flag.SATURATED,) if value in (1.0, 3e38) else ()
    return judged(standard_sensor(), standard_press(), SPOILT_UM, frame=frame, needs=needs)


def _missing_channels() -> list[Case]:
    required = tr("treated as missing and flagged; the rest of the map is unchanged")
    cases = [
        ("patch_saturated", tr("one channel saturated over 2 mm"), 1.0, (0,), Flag.SATURATED),
        ("patch_dark", tr("one channel dark over 2 mm"), 0.0, (1,), Flag.DARK),
        ("patch_two_dark", tr("two channels dark over 2 mm"), 0.0, (0, 2), Flag.DARK),
        ("patch_all_dark", tr("all channels dark over 2 mm"), 0.0, (0, 1, 2), Flag.DARK),
        ("patch_nan", tr("all channels not a number over 2 mm"), np.nan, (0, 1, 2), None),
    ]
    return [
        _case(name, label, required, partial(_with_patch, value, channels, flag))
        for name, label, value, channels, flag in cases
    ]


def _with_patch(value: float, channels: tuple[int, ...], flag: Flag | None) -> Seen:
    known, press = standard_sensor(), standard_press()
    table = known.calibration.table
    x, y = np.meshgrid(table.grid.x_mm, table.grid.y_mm)
    hidden = np.hypot(x + 6.0, y - 1.0) < HIDDEN_MM
    frame = press.frame.copy()
    rows, columns = (np.rint(m[hidden]).astype(int) for m in (table.v_px, table.u_px))
    for channel in channels:
        frame[rows, columns, channel] = value
    wider = np.hypot(x + 6.0, y - 1.0) < HIDDEN_MM + 0.3
    # Two lights over a wide patch are sufficient; one or none is not.
    bound = SPOILT_UM if len(channels) == 1 else 2.0 * SPOILT_UM
    needs = () if flag is None else (flag,)
    return judged(known, press, bound, frame=frame, spare=wider, needs=needs)


def _whole_images() -> list[Case]:
    def like(make: Callable[[Map], NDArray[Any]]) -> Callable[[], Seen]:
        return lambda: _not_of_this_sensor(make(standard_press().frame))

    required = tr("finite, and the map reports that it is not reliable")
    cases: list[tuple[str, str, Callable[[Map], NDArray[Any]]]] = [
        ("all_black", tr("an all black image"), np.zeros_like),
        ("all_white", tr("an all white image"), np.ones_like),
        ("all_grey", tr("every pixel 0.5"), lambda f: np.full_like(f, 0.5)),
        ("all_dim", tr("every pixel 0.1"), lambda f: np.full_like(f, 0.1)),
        ("all_nan", tr("all pixels not a number"), lambda f: np.full_like(f, np.nan)),
        ("all_inf", tr("every pixel infinite"), lambda f: np.full_like(f, np.inf)),
        ("denormals", tr("every pixel times 1e-40"), lambda f: f * np.float32(1e-40)),
        ("negated", tr("every pixel negated"), np.negative),
        ("doubled", tr("twice the exposure"), lambda f: f * np.float32(2.0)),
        ("halved", tr("half the exposure"), lambda f: f * np.float32(0.5)),
        ("blue_first", tr("blue and red exchanged"), lambda f: f[..., ::-1]),
        ("upside_down", tr("the image upside down"), lambda f: f[::-1]),
        ("noise", tr("only noise"), _noise),
        ("scale_255", tr("floats of 0..255 instead of 0..1"), lambda f: f * np.float32(255.0)),
        ("twelve_bit", tr("12 bits in a 16 bit file"), lambda f: (f * 4095.0).astype(np.uint16)),
        ("light_10_percent", tr("light 10 % weaker"), lambda f: f * np.float32(0.9)),
    ]
    return [_case(name, label, required, like(make)) for name, label, make in cases]


def _other_light() -> list[Case]:
    required = tr("measured, corrected and accurate")
    cases: list[tuple[str, str, Callable[[Map], Map]]] = [
        ("light_2_percent", tr("light 2 % stronger"), lambda f: f * np.float32(1.02)),
        ("red_2_percent", tr("red light 2 % stronger"), _redder),
    ]
    return [_case(name, label, required, partial(_brighter, make)) for name, label, make in cases]


def _brighter(make: Callable[[Map], Map]) -> Seen:
    press = standard_press()
    return judged(standard_sensor(), press, SPOILT_UM, frame=make(press.frame))


def _redder(frame: Map) -> Map:
    return frame * np.array([1.02, 1.0, 1.0], np.float32)


def _noise(frame: Map) -> Map:
    return np.random.default_rng(0).random(frame.shape).astype(np.float32)


def _not_of_this_sensor(frame: NDArray[Any]) -> Seen:
    """Reconstruct an impossible image; each model must report it."""
    known, press = standard_sensor(), standard_press()
    found = maps_of(known, frame)
    warnings = {model: warnings_of(found[model]) for model in MODELS}
    best = found["full"]
    error = rms_um(depth_error(best, press.truth, radius_mm=12.0))
    silent = [model for model in MODELS if not warnings[model]]
    summary = tr("{e:.0f} um RMS").format(e=error)
    if silent:
        summary += "; " + tr("no note by the model {names}").format(names=", ".join(silent))
    return Seen(
        right=False,
        summary=summary,
        finite=all(is_finite(h) for h in found.values()),
        error_um=error,
        flags=flag_shares(best),
        condition=condition_of(known.calibration),
        warning="" if silent else warnings["full"][0],
    )


def _kinds() -> list[Case]:
    required = tr("the same depth, or an error that names the type")
    makers: dict[str, Callable[[Map], NDArray[Any]]] = {
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
        "turned_in_memory": lambda f: np.asfortranarray(f),
        "read_only": _read_only,
    }
    label = tr("an image of type {kind}")
    return [
        _case(
            f"kind_{kind}", label.format(kind=kind.replace("_", " ")), required, partial(_as, make)
        )
        for kind, make in makers.items()
    ]


def _read_only(frame: Map) -> Map:
    copy = frame.copy()
    copy.flags.writeable = False
    return copy


def _as(make: Callable[[Map], NDArray[Any]]) -> Seen:
    """Reconstruct other number types, which must give the usual depth."""
    known, press = standard_sensor(), standard_press()
    frame = make(press.frame)
    seen = judged(known, press, BESIDE_UM, frame=frame)
    depths = [Reconstructor(known.calibration).depth(f).depth_mm for f in (frame, press.frame)]
    apart = rms_um((depths[0] - depths[1]).astype(np.float64))
    text = tr("{summary}; {d:.2f} um from the usual number type")
    summary = text.format(summary=seen.summary, d=apart)
    return replace(seen, summary=summary, right=seen.right and apart < SAME_UM)


def _contacts() -> list[Case]:
    x_mm, y_mm = BALL_AT_MM
    return [
        _case(
            "contact_of_a_pixel",
            tr("a ball of 0.15 mm, 0.03 mm deep: a contact one pixel wide"),
            tr("finite, and nowhere deeper than the true depth"),
            lambda: _small(Ball(0.15, 0.03)),
        ),
        _case(
            "one_bright_pixel",
            tr("one pixel 30 % brighter"),
            tr("no dent deeper than the slope of one pixel can cause"),
            _one_bright_pixel,
        ),
        _case(
            "no_contact",
            tr("the untouched membrane"),
            tr("flat"),
            lambda: judged(
                standard_sensor(),
                standard_sensor().pressed(Ball(4.0, 0.0), x_mm=x_mm, y_mm=y_mm),
                0.1,
            ),
        ),
    ]


def _small(ball: Ball) -> Seen:
    known = standard_sensor()
    press = known.pressed(ball, x_mm=0.3, y_mm=0.2)
    return judged(known, press, 2.0, radius_mm=3.0)


def _one_bright_pixel() -> Seen:
    known = standard_sensor()
    frame = known.bare()
    row, column = frame.shape[0] // 2, frame.shape[1] // 2
    frame[row, column] *= 1.3
    found = Reconstructor(known.calibration).depth(frame)
    deepest = float(np.abs(found.depth_mm).max())
    pitch = found.pitch_mm
    return Seen(
        right=deepest < pitch,
        summary=tr("at most {d:.1f} um deep beside {p:.0f} um of a pixel").format(
            d=1e3 * deepest, p=1e3 * pitch
        ),
        finite=is_finite(found),
        error_um=rms_um(np.asarray(found.depth_mm[~flagged(found, Flag.OUTSIDE)], np.float64)),
        flags=flag_shares(found),
    )
