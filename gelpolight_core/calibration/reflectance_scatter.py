"""The scatter of ball pixels behind a reflectance table, gathered from the session when needed.

A run does not keep it: it is a million numbers that can be computed from the session's images.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    names : tuple of str
        Image names of the presses.
    """

    cosines: tuple[Float64Array, ...]
    values: tuple[Float64Array, ...]
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
    paths = (run.session.folder / press.name for press in presses)
    response = run.calibration.response
    images = (table.apply(read_linear_image(path, response=response).rgb) for path in paths)
    cosines, values = zip(
        *ball_scatter(presses, images, table, leds, radiance, factors), strict=True
    )
    return ReflectanceScatter(cosines, values, tuple(press.name for press in presses))
