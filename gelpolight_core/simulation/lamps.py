"""The lights of the virtual sensor: small near lamps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .sensor_design import SensorDesign


@dataclass(frozen=True, slots=True)
class PointLamp:
    """A small disc parallel to the top surface that radiates towards it.

    Its light goes straight to the surface, also from below the elastomer, where it is not absorbed.

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
    axis_tilt : (x, y)
        Slopes of the lamp's axis against the normal of the top surface.
    absorption_per_mm : float
        Of its light in the elastomer.
    elastomer_mm : float
        Thickness of the elastomer.
    """

    x_mm: float
    y_mm: float
    height_mm: float
    power: float = 1.0
    lobe_exponent: float = 1.0
    diameter_mm: float = 0.2
    axis_tilt: tuple[float, float] = (0.0, 0.0)
    absorption_per_mm: float = 0.0
    elastomer_mm: float = math.inf

    def row(self) -> tuple[float, ...]:
        """Return the lamp in the format of the compiled code."""
        tilt_x, tilt_y = self.axis_tilt
        along = 1.0 / math.sqrt(1.0 + tilt_x * tilt_x + tilt_y * tilt_y)
        return (
            self.x_mm,
            self.y_mm,
            -self.height_mm,
            self.power,
            self.lobe_exponent,
            0.5 * self.diameter_mm,
            tilt_x * along,
            tilt_y * along,
            along,
            self.absorption_per_mm,
            self.elastomer_mm,
        )


def lamps_of(design: SensorDesign) -> tuple[PointLamp, ...]:
    """Return the three lamps of a design."""
    ring, layers = design.ring, design.layers
    return tuple(
        PointLamp(
            led.x_mm,
            led.y_mm,
            led.height_mm,
            led.power,
            ring.lobe_exponent,
            ring.disc_diameter_mm,
            led.axis_tilt,
            absorption,
            layers.elastomer_thickness_mm,
        )
        for led, absorption in zip(design.leds, layers.elastomer_absorption_per_mm, strict=True)
    )


def lamp_table(
    lamps: tuple[PointLamp, ...],
    *,
    axis_mm: tuple[float, float] = (0.0, 0.0),
    apex_height_mm: float = 0.0,
) -> Float64Array:
    """Return (lamps, 11) float64 for the compiled code.

    The columns are x, y and z, power, exponent of the lobe, radius, the three parts of the axis,
    absorption per mm, and thickness of the elastomer.

    Parameters
    ----------
    lamps : tuple of PointLamp
        The lights.
    axis_mm, apex_height_mm : (x, y), float, optional
        Axis and apex of the membrane: the origin of the table, and the top of its elastomer.
    """
    table = np.array([lamp.row() for lamp in lamps], dtype=np.float64)
    table[:, :3] -= [*axis_mm, apex_height_mm]
    table[:, 10] += apex_height_mm
    return table
