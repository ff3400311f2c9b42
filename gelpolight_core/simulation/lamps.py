"""The lights of the virtual sensor: small near lamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .sensor_design import SensorDesign


@dataclass(frozen=True, slots=True)
class PointLamp:
    """A small disc parallel to the top surface that radiates towards it.

    Attributes
    ----------
    x_mm, y_mm, height_mm : float
        Sensor frame; height below the top surface.
    power : float
        Irradiance on a facing surface at 1 mm on the lamp's axis.
    lobe_exponent : float
        Intensity is cos^exponent of the angle to the lamp's axis.
    diameter_mm : float
        Diameter of the disc; gives shadows their soft edge.
    """

    x_mm: float
    y_mm: float
    height_mm: float
    power: float = 1.0
    lobe_exponent: float = 1.0
    diameter_mm: float = 0.2

    def row(self) -> tuple[float, ...]:
        """Return the lamp in the format of the compiled code."""
        radius = 0.5 * self.diameter_mm
        return self.x_mm, self.y_mm, -self.height_mm, self.power, self.lobe_exponent, radius


def lamps_of(design: SensorDesign) -> tuple[PointLamp, ...]:
    """Return the three lamps of a design."""
    ring = design.ring
    return tuple(
        PointLamp(
            led.x_mm, led.y_mm, led.height_mm, led.power, ring.lobe_exponent, ring.disc_diameter_mm
        )
        for led in design.leds
    )


def lamp_table(lamps: tuple[PointLamp, ...]) -> Float64Array:
    """Return (lamps, 6) float64 for the compiled code."""
    return np.array([lamp.row() for lamp in lamps], dtype=np.float64)
