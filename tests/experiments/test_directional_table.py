"""The directional table does what it is made for, and what it is not made for it does badly."""

from __future__ import annotations

import numpy as np
import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.experiments.directional_table import (
    BallSamples,
    DirectionalTable,
    fit_directional_table,
)
from gelpolight_core.experiments.known_sensor import exact_calibration, matt_design
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.simulation.indenters import Ball, press
from gelpolight_core.simulation.lamps import ParallelLamp
from gelpolight_core.simulation.virtual_sensor import BareMembrane, PressedMembrane, VirtualSensor

PLACES_MM = ((-5.0, -4.0), (5.0, -3.0), (0.0, 5.5), (-4.5, 4.0), (4.0, 3.0))
EVEN = tuple(ParallelLamp(azimuth, 50.0) for azimuth in (90.0, 210.0, 330.0))


def picture(sensor: VirtualSensor, table: ResamplingTable, at_mm: tuple[float, float]):  # type: ignore[no-untyped-def]
    surface = press(Ball(4.0, 1.2), x_mm=at_mm[0], y_mm=at_mm[1], decay_mm=0.7)
    frame = sensor.brightness(PressedMembrane(surface), samples=1).astype(np.float32)
    x, y = np.meshgrid(table.grid.x_mm - at_mm[0], table.grid.y_mm - at_mm[1])
    return frame, x, y


def fitted(sensor: VirtualSensor) -> DirectionalTable:
    table = exact_calibration(VirtualSensor(matt_design(0.2))).table
    background = table.apply(sensor.brightness(BareMembrane()).astype(np.float32))
    balls = []
    for place in PLACES_MM:
        frame, x, y = picture(sensor, table, place)
        change = table.apply(frame) - background
        inside = np.hypot(x, y) < 2.3
        below = np.sqrt(16.0 - x[inside] ** 2 - y[inside] ** 2)
        slopes = np.stack([-x[inside] / below, -y[inside] / below], axis=-1)
        balls.append(BallSamples(change[inside], slopes.astype(np.float32)))
    flat = np.zeros((200, 3), np.float32)
    return fit_directional_table(balls, background, table, flat=flat)


def relative_error(sensor: VirtualSensor) -> float:
    """Return the error of the slope inside a contact that the table has not seen, over its size."""
    directional = fitted(sensor)
    frame, x, y = picture(sensor, directional.table, (1.5, -1.0))
    found_x, found_y = directional.slopes_of(frame)
    inside = np.hypot(x, y) < 2.0
    below = np.sqrt(16.0 - x[inside] ** 2 - y[inside] ** 2)
    away = np.hypot(found_x[inside] + x[inside] / below, found_y[inside] + y[inside] / below)
    return float(np.median(away) / np.median(np.hypot(x, y)[inside] / below))


def test_parallel_even_light_is_read_and_near_light_is_not() -> None:
    design = matt_design(0.2)
    parallel = relative_error(VirtualSensor(design, lamps=EVEN))
    near = relative_error(VirtualSensor(design))
    assert parallel < 0.15
    assert near > 1.5 * parallel


def test_balls_that_show_nothing_are_refused() -> None:
    nothing = BallSamples(np.zeros((3, 3), np.float32), np.zeros((3, 2), np.float32))
    table = exact_calibration(VirtualSensor(matt_design(0.1))).table
    background = np.zeros((*table.grid.shape, 3), np.float32)
    with pytest.raises(InputError, match="3 pixels"):
        fit_directional_table([nothing], background, table, flat=np.zeros((10, 3), np.float32))
