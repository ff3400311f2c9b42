"""Extreme calibrations: maps with holes, invalid curves, modified files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.sensor_calibration import Calibration, FullModel
from gelpolight_core.studies.known_sensor import KnownSensor
from gelpolight_core.studies.stability import Case, Seen, group, seen_once
from gelpolight_core.studies.trial import (
    is_finite,
    judged,
    standard_press,
    standard_sensor,
)

Change = Callable[[Calibration], dict[str, Any]]


def calibration_cases() -> list[Case]:
    """Return the cases on calibrations."""
    holes = {"factor_zero": partial(_hole, "factors"), "light_zero": partial(_hole, "radiance")}
    unusable: dict[str, Callable[[], Seen]] = {
        "light_zero_everywhere": _all_dark,
        "leds_above_membrane": _leds_above,
    }
    changed: dict[str, Change] = {
        "curve_falling": lambda c: _with_curve(c, c.open_sensor.reflectance.values[0][::-1]),
        "curve_of_nan": lambda c: _with_curve(c, np.nan * c.open_sensor.reflectance.values[0]),
        "light_nan": lambda c: {"radiance": np.nan * c.open_sensor.radiance},
        "light_negative": lambda c: {"radiance": -c.open_sensor.radiance},
        "leds_nan": lambda c: {"led_positions_mm": np.nan * c.open_sensor.led_positions_mm},
        "plane_behind_camera": lambda c: {
            "plane": TopPlane((0, 0, -1), c.open_sensor.plane.distance_mm)
        },
        "crosstalk_singular": lambda _: {"crosstalk": np.ones((3, 3))},
    }
    read = {name: partial(_read, change) for name, change in changed.items()}
    return [
        *group("calibrations", "0 over 1 mm: masked, and correct elsewhere", holes),
        *group("calibrations", "refused", unusable),
        *group("calibrations", "refused when the file is read", read),
        *group("calibrations", "finite and named", {"light_beyond_curve": _beyond}),
    ]


def _standard() -> tuple[Calibration, FullModel]:
    calibration = standard_sensor().calibration
    assert calibration.open_sensor.full is not None
    return calibration, calibration.open_sensor.full


def _with(calibration: Calibration, *, needs: tuple[Flag, ...] = ()) -> Seen:
    known = KnownSensor(standard_sensor().sensor, calibration)
    # As of bad pixels: a hole of 1 mm beside a press of 1 mm.
    return judged(known, standard_press(), 8.0, needs=needs)


def _hole(field: str) -> Seen:
    calibration, full = _standard()
    grid = calibration.table.grid
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    known = (np.hypot(x + 6.0, y) >= 0.5)[..., None]
    holed = {field: getattr(calibration.data, field) * known}
    full = replace(full, background=full.background * known)
    return _with(calibration.changed(full=full, **holed), needs=(Flag.OUTSIDE,))


def _all_dark() -> Seen:
    calibration, _ = _standard()
    return _with(calibration.changed(radiance=np.zeros_like(calibration.open_sensor.radiance)))


def _leds_above() -> Seen:
    calibration, full = _standard()
    leds = calibration.open_sensor.led_positions_mm * np.array([1.0, 1.0, -1.0])
    full = replace(full, led_positions_mm=leds)
    return _with(calibration.changed(led_positions_mm=leds, full=full))


def _read(change: Change) -> Seen:
    """Write a changed calibration and read it again; it must be refused."""
    calibration, _ = _standard()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "changed.gplcal"
        write_calibration(calibration.changed(**change(calibration)), path)
        read_calibration(path)
    return seen_once(False, "it was read without an error")


def _with_curve(calibration: Calibration, values: NDArray[np.float64]) -> dict[str, Any]:
    table = calibration.open_sensor.reflectance
    three = ReflectanceTable(table.cosines, (values, values, values), table.coverage)
    return {"reflectance": three}


def _beyond() -> Seen:
    """Take a table whose brightest value is below what the image shows."""
    calibration, _ = _standard()
    low = _with_curve(calibration, 0.5 * calibration.open_sensor.reflectance.values[0])
    found = Reconstructor(replace(calibration.changed(full=None, **low), model="paper")).depth(
        standard_press().frame
    )
    deepest = float(np.abs(found.depth_mm).max())
    named = ", ".join(finding.key for finding in found.findings)
    return seen_once(is_finite(found) and "exposure" in named, f"{named}; at most {deepest:.1f} mm")
