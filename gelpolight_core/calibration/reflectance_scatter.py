"""The scatter of ball pixels behind a reflectance table, gathered from the session when needed.

A run does not keep it: it is a million numbers that can be computed from the session's images.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.stages.balls.reflectance_stage import ball_scatter

from .open_ball_stages import REFLECTANCE
from .open_sensor_recipe import BACKGROUND, LIGHTS
from .project import CalibrationRun


@dataclass(frozen=True, slots=True)
class ReflectanceScatter:
    """Ball pixels as used by the reflectance table, for each channel.

    Attributes
    ----------
    cosines, values : tuple of 3 (N,) arrays
        cos(theta) from the ball's normals, and processed pixel values I / (rho |L|).
    presses : tuple of 3 (N,) int arrays
        Index in `names` of the press of each pixel.
    names : tuple of str
        Image names of the presses.
    """

    cosines: tuple[Float64Array, ...]
    values: tuple[Float64Array, ...]
    presses: tuple[NDArray[np.intp], ...]
    names: tuple[str, ...]


def gather_scatter(run: CalibrationRun) -> ReflectanceScatter:
    """Gather the scatter of a run's ball presses, with the factors fed back (section V-E).

    Parameters
    ----------
    run : CalibrationRun
        Calibration of an open sensor.

    Raises
    ------
    InputError
        If a ball image can no longer be read.
    """
    reflectance, radiance = run.results[REFLECTANCE], run.results[BACKGROUND].radiance
    table, factors = run.calibration.table, reflectance.factors.factors
    presses = reflectance.table.presses
    leds = run.results[LIGHTS].leds.led_positions_mm
    scatter_by_press = []
    for press in presses:
        path = run.session.folder / press.name
        image = table.apply(read_linear_image(path, response=run.calibration.response).rgb)
        scatter_by_press.append(ball_scatter([press], [image], table, leds, radiance, factors))
    channels = list(zip(*scatter_by_press, strict=True))
    numbers = np.arange(len(presses))
    return ReflectanceScatter(
        tuple(np.concatenate([cosines for cosines, _ in channel]) for channel in channels),
        tuple(np.concatenate([values for _, values in channel]) for channel in channels),
        tuple(np.repeat(numbers, [len(cosines) for cosines, _ in c]) for c in channels),
        tuple(press.name for press in presses),
    )
