"""Extreme calibrations: maps with holes, invalid curves, modified files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.design_check.known_sensor import KnownSensor
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.stability import Case, Seen
from gelpolight_core.experiments.stability_trial import (
    judged,
    standard_press,
    standard_sensor,
)
from gelpolight_core.optics.frame import TopPlane
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reflectance.table import ReflectanceTable
from gelpolight_core.sensor_calibration import Calibration, FullModel
from gelpolight_core.translation import tr

SUBJECT = "calibrations"
HOLED_UM = 8.0


def calibration_cases() -> tuple[Case, ...]:
    """Return the cases on calibrations."""
    refused = tr("refused when the file is read")
    masked = tr("masked; the map is finite, and correct elsewhere")
    entries: list[tuple[str, str, str, Callable[[], Seen]]] = [
        ("factor_zero", tr("factors 0 over 1 mm"), masked, partial(_hole, "factors")),
        ("light_zero", tr("light 0 over 1 mm"), masked, partial(_hole, "radiance")),
        ("everywhere_dark", tr("light 0 everywhere"), tr("refused"), _all_dark),
        (
            "table_not_monotone",
            tr("a reflectance curve that decreases"),
            refused,
            partial(_read, _falling),
        ),
        ("table_of_nan", tr("a reflectance curve with a gap"), refused, partial(_read, _gap)),
        ("light_nan", tr("light that is not a number"), refused, partial(_read, _light_nan)),
        ("light_negative", tr("light below zero"), refused, partial(_read, _light_negative)),
        ("leds_above", tr("LEDs above the membrane"), tr("refused"), _leds_above),
        ("leds_nan", tr("an LED position that is not a number"), refused, partial(_read, _led_nan)),
        ("plane_backwards", tr("a plane behind the camera"), refused, partial(_read, _backwards)),
        (
            "crosstalk_singular",
            tr("a crosstalk matrix that cannot be inverted"),
            refused,
            partial(_read, _mixed),
        ),
        (
            "brighter_than_the_table",
            tr("light beyond the end of the reflectance curve"),
            tr("clipped, finite and flagged"),
            _beyond,
        ),
    ]
    return tuple(Case(name, SUBJECT, label, what, run) for name, label, what, run in entries)


def _known(calibration: Calibration) -> KnownSensor:
    return KnownSensor(standard_sensor().sensor, calibration)


def _full(calibration: Calibration) -> FullModel:
    assert calibration.full is not None
    return calibration.full


def _hole(field: str) -> Seen:
    calibration = standard_sensor().calibration
    grid = calibration.table.grid
    x, y = np.meshgrid(grid.x_mm, grid.y_mm)
    hole = np.hypot(x + 6.0, y) < 0.5
    values = getattr(calibration, field).copy()
    values[hole] = 0.0
    background = _full(calibration).background.copy()
    background[hole] = 0.0
    holed = replace(
        calibration,
        full=replace(_full(calibration), background=background),
        **{field: values},
    )
    return judged(_known(holed), standard_press(), HOLED_UM, needs=(Flag.OUTSIDE,))


def _all_dark() -> Seen:
    calibration = standard_sensor().calibration
    dark = replace(calibration, radiance=np.zeros_like(calibration.radiance))
    return judged(_known(dark), standard_press(), HOLED_UM)


def _read(change: Callable[[Calibration], Calibration]) -> Seen:
    """Write a changed calibration and read it again; it must be refused."""
    changed = change(standard_sensor().calibration)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "changed.gplcal"
        write_calibration(changed, path)
        try:
            read_calibration(path)
        except InputError as error:  # without the path of a folder that no longer exists
            raise InputError(error.found, where=path.name, advice=error.advice) from error
    return Seen(False, tr("it was read without an error"))


def _with_table(calibration: Calibration, values: NDArray[np.float64]) -> Calibration:
    table = calibration.reflectance
    three = ReflectanceTable(table.cosines, (values, values, values), table.coverage)
    return replace(calibration, reflectance=three)


def _falling(calibration: Calibration) -> Calibration:
    values = calibration.reflectance.values[0].copy()
    values[4], values[5] = values[5], values[4]
    return _with_table(calibration, values)


def _gap(calibration: Calibration) -> Calibration:
    values = calibration.reflectance.values[0].copy()
    values[5] = np.nan
    return _with_table(calibration, values)


def _light_nan(calibration: Calibration) -> Calibration:
    return replace(calibration, radiance=np.full_like(calibration.radiance, np.nan))


def _light_negative(calibration: Calibration) -> Calibration:
    return replace(calibration, radiance=-calibration.radiance)


def _led_nan(calibration: Calibration) -> Calibration:
    leds = calibration.led_positions_mm.copy()
    leds[1, 0] = np.nan
    return replace(calibration, led_positions_mm=leds)


def _leds_above() -> Seen:
    calibration = standard_sensor().calibration
    leds = calibration.led_positions_mm * np.array([1.0, 1.0, -1.0])
    moved = replace(
        calibration, led_positions_mm=leds, full=replace(_full(calibration), led_positions_mm=leds)
    )
    return judged(_known(moved), standard_press(), HOLED_UM)


def _backwards(calibration: Calibration) -> Calibration:
    return replace(calibration, plane=TopPlane((0.0, 0.0, -1.0), calibration.plane.distance_mm))


def _mixed(calibration: Calibration) -> Calibration:
    return replace(calibration, crosstalk=np.ones((3, 3)))


def _beyond() -> Seen:
    """Take a table whose brightest value is below what the image shows."""
    calibration = standard_sensor().calibration
    table = calibration.reflectance
    red, green, blue = (0.5 * values for values in table.values)
    low = replace(table, values=(red, green, blue))
    short = replace(calibration, reflectance=low, model="paper", full=None)
    found = Reconstructor(short).depth(standard_press().frame)
    extrapolated = float(np.mean((found.flags & int(Flag.EXTRAPOLATED)) != 0))
    deepest = float(np.abs(found.depth_mm).max())
    return Seen(
        extrapolated > 0.1,
        tr("{share:.0f} % of the nodes flagged; at most {d:.1f} mm").format(
            share=100.0 * extrapolated, d=deepest
        ),
        bool(np.isfinite(found.depth_mm).all()),
    )
