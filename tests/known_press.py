"""Presses on sensors whose calibration is exact, in cells as fine as the image shows them."""

from functools import cache

from gelpolight_core.simulation.indenters import Indenter, image_pitch_mm, press_surface
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.studies import exact_sensor as exact
from gelpolight_core.studies.exact_sensor import ExactPress, ExactSensor


@cache
def known_sensor(design: SensorDesign, seed: int = 0) -> ExactSensor:
    """Return the virtual sensor of a design with its exact calibration, made once a process."""
    return exact.known_sensor(design, seed=seed)


def on(
    known: ExactSensor,
    indenter: Indenter,
    *,
    x_mm: float = 0.0,
    y_mm: float = 0.0,
    samples: int = 1,
) -> ExactPress:
    """Return the image of an object pressed into a sensor, and the true depth."""
    design = known.sensor.design
    decay_mm, pitch_mm = design.membrane.decay_length_mm, image_pitch_mm(design)
    surface = press_surface(
        indenter,
        x_mm=x_mm,
        y_mm=y_mm,
        decay_mm=decay_mm,
        rest=design.membrane,
        pitch_mm=pitch_mm,
    )
    return known.showing(surface, samples)
