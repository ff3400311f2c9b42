"""Runs of extreme presses: changed images and sensors, each against its truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.geometry.refraction import camera_to_membrane
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.simulation.indenters import Indenter
from gelpolight_core.simulation.pressed_surface import PressedSurface
from gelpolight_core.simulation.sensor_design import SensorDesign

from .exact_sensor import known_sensor
from .image_case_helpers import (
    BALL,
    BALL_AT_MM,
    is_finite,
    measure_all_modes,
    standard_press,
    standard_sensor,
)
from .stability import CaseMeasurement, ModeResult

ImageModifier = Callable[[Float32Array], NDArray[Any]]
SPOILT_UM = 8.0
"""Accepted error with 40 bad pixels (0.05 %), on a press of 1 mm."""
RIGHT_UM = 10.0
"""One per cent of a press of 1 mm."""
HIDDEN_MM = 1.0
CONE_PITCH_MM = 0.01


def on_image(change: ImageModifier, bound_um: float = SPOILT_UM, **how: Any) -> CaseMeasurement:
    """Reconstruct a changed image of the standard press."""
    press = standard_press()
    return measure_all_modes(standard_sensor(), press, bound_um, frame=change(press.frame), **how)


def bad_pixels(value: float, frame: Float32Array) -> Float32Array:
    """Return an image with 40 single pixels of a value."""
    frame = frame.copy()
    rng = np.random.default_rng(0)
    rows, columns = (rng.integers(20, n - 20, 40) for n in frame.shape[:2])
    frame[rows, columns] = value
    return frame


def patch(value: float, channels: tuple[int, ...], *needs: Flag) -> CaseMeasurement:
    """Reconstruct with a value in some channels of a patch of 2 mm."""
    table, frame = standard_sensor().calibration.table, standard_press().frame.copy()
    distance_mm = np.hypot(*(table.grid.points_mm() - (-6.0, 1.0)).T).T
    hole_mask = distance_mm < HIDDEN_MM
    rows, columns = (np.rint(m[hole_mask]).astype(int) for m in (table.v_px, table.u_px))
    for channel in channels:
        frame[rows, columns, channel] = value
    # Two lights over a wide patch are sufficient; one or none is not.
    bound_um = SPOILT_UM if len(channels) == 1 else 2.0 * SPOILT_UM
    return on_image(lambda _: frame, bound_um, spare=distance_mm < HIDDEN_MM + 0.3, needs=needs)


def one_bright_pixel() -> CaseMeasurement:
    """Reconstruct the bare membrane with one pixel that is too bright."""
    frame = standard_sensor().bare()
    frame[frame.shape[0] // 2, frame.shape[1] // 2] *= 1.3
    result = Reconstructor(standard_sensor().calibration).depth(frame)
    deepest = float(np.abs(result.depth_mm).max())
    pixel_um = 1e3 * result.pitch_mm
    summary = f"at most {1e3 * deepest:.1f} um deep beside {pixel_um:.0f} um of a pixel"
    right = is_finite(result) and deepest < result.pitch_mm
    return CaseMeasurement(summary, (ModeResult("", right),))


_known = lru_cache(maxsize=1)(known_sensor)


def pressed(
    design: SensorDesign,
    shape: Indenter | PressedSurface = BALL,
    at_mm: tuple[float, float] = BALL_AT_MM,
    *,
    bound_um: float = RIGHT_UM,
    noisy: bool = False,
    radius_mm: float | None = None,
) -> CaseMeasurement:
    """Press an object, or a membrane of any shape, into a sensor."""
    sensor = _known(design)
    if isinstance(shape, PressedSurface):
        press = sensor.showing(shape)
    else:
        press = sensor.pressed(shape, x_mm=at_mm[0], y_mm=at_mm[1])
    frame = sensor.noisy(press.frame) if noisy else None
    return measure_all_modes(sensor, press, bound_um, frame=frame, radius_mm=radius_mm)


def cone(design: SensorDesign, degrees: float) -> CaseMeasurement:
    """Press a frustum that the membrane follows completely, with foot and edge."""
    steps = round(6.0 / CONE_PITCH_MM)
    axis = CONE_PITCH_MM * np.arange(-steps, steps + 1)
    x, y = np.meshgrid(axis, axis)
    flank = (3.0 - np.hypot(x, y)) * math.tan(math.radians(degrees))
    depth = np.clip(flank, 0.0, 1.0)
    start_mm = float(axis[0])
    return pressed(design, PressedSurface(depth, depth > 0.0, start_mm, start_mm, CONE_PITCH_MM))


def through_lens(design: SensorDesign) -> CaseMeasurement:
    """Press a ball, and project every node to its pixel and back."""
    calibration = _known(design).calibration
    sensor, table = calibration.open_sensor, calibration.table
    pixels = np.stack([table.u_px, table.v_px], axis=-1)[table.valid].astype(np.float64)
    points, _ = camera_to_membrane(sensor.camera.directions(pixels), sensor.plane, sensor.stack)
    max_error_mm = float(np.hypot(*(points - table.grid.points_mm()[table.valid]).T).max())
    # A wide-angle lens has large pixels: 3 % of a pixel if that is more.
    result = pressed(design, bound_um=max(RIGHT_UM, 30.0 * table.grid.pitch_mm), radius_mm=7.0)
    # Pixels are kept in single precision: some thousandths of a pixel.
    agrees = max_error_mm < 0.02 * table.grid.pitch_mm
    summary = f"{result.summary}; forward and back within {max_error_mm:.2g} mm"
    if not agrees:
        modes = tuple(replace(mode, right=False, warning="") for mode in result.modes)
        result = replace(result, modes=modes)
    return replace(result, summary=summary)
