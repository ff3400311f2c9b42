"""Presses on sensors whose calibration is exact, in cells as fine as the image shows them."""

from functools import cache

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.indenters import Indenter, image_pitch_mm, press
from gelpolight_core.studies import known_sensor as exact
from gelpolight_core.studies.known_sensor import KnownPress, KnownSensor


@cache
def known_sensor(design: SensorDesign, seed: int = 0) -> KnownSensor:
    """Return the virtual sensor of a design with its exact calibration, made once a process."""
    return exact.known_sensor(design, seed=seed)


def on(
    known: KnownSensor,
    indenter: Indenter,
    *,
    x_mm: float = 0.0,
    y_mm: float = 0.0,
    samples: int = 1,
) -> KnownPress:
    """Return the image of an object pressed into a sensor, and the true depth."""
    design = known.sensor.design
    decay_mm, pitch_mm = design.membrane.decay_length_mm, image_pitch_mm(design)
    surface = press(indenter, x_mm=x_mm, y_mm=y_mm, decay_mm=decay_mm, pitch_mm=pitch_mm)
    return known.showing(surface, samples)
