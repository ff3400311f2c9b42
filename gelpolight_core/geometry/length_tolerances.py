"""Tolerances of the lengths that the user states, and their effect on all results.

No image shows such a small error. The board on the top surface is seen in air: its squares give the
distance of the surface. Through the elastomer, the surface appears nearer, depending on thickness
and index. Lateral lengths are proportional to this apparent distance, and slopes to the ball radii.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .refraction import LayerStack

SQUARE_SD = 0.003
"""Relative standard deviation of the squares of the board on the top surface: a printed board, or
0.05 mm of a caliper over eight squares of 2 mm."""
RADIUS_SD = 0.002
"""The same of the ball radii; bearing balls are better."""
THICKNESS_SD = 0.01
"""The same of each layer's thickness."""
INDEX_SD = 0.01
"""The same of each layer's refractive index: 0.014 of a silicone's."""
HEIGHT_BY_RADIUS = 0.66
"""Relative change of a height by that of all ball radii (docs/studies/stability.md)."""
HEIGHT_BY_LATERAL = 1.0 + HEIGHT_BY_RADIUS
"""The same by that of all lateral lengths: slopes follow from lateral lengths over radii."""
SHOWN_SD = 0.01
"""Relative standard deviation of a common factor on all radii that one ball press shows: seven
calibrations with ten presses each, of sensors with exact radii, are off by 0.3 % (rms)."""


class StatedSd(NamedTuple):
    """Relative standard deviations from stated lengths, common to all results of a calibration.

    Attributes
    ----------
    depth : float
        Standard deviation of depths: the same share of shallow and deep ones.
    lateral : float
        Standard deviation of lateral lengths.
    """

    depth: float
    lateral: float


def stated_sd(stack: LayerStack, shown: tuple[float, float] | None = None) -> StatedSd:
    """Return the standard deviations by the tolerances of the stated lengths.

    If all lateral lengths are too large, the balls look larger than stated: both are known better
    than stated if the ball presses show the radii.

    Parameters
    ----------
    stack : LayerStack
        Layers between camera and top surface, with air where there is no other.
    shown : (float, float), optional
        How much larger than stated all balls look, relative, and its standard deviation.
    """
    thickness = np.asarray(stack.thicknesses_mm, np.float64)
    index = np.asarray(stack.indices, np.float64)
    apparent_mm = float((thickness / index).sum())
    is_solid = index > 1.0
    by_square = SQUARE_SD * float(thickness.sum())
    # A thicker layer leaves less air below the same surface.
    by_thickness = THICKNESS_SD * (thickness * (1.0 - 1.0 / index))[is_solid]
    by_index = INDEX_SD * (thickness / index)[is_solid]
    lateral = float(np.linalg.norm([by_square, *by_thickness, *by_index])) / apparent_mm
    covariance = np.diag([lateral, RADIUS_SD]) ** 2
    effects = np.array([[HEIGHT_BY_LATERAL, -HEIGHT_BY_RADIUS], [1.0, 0.0]])
    square = ((effects @ covariance) * effects).sum(axis=1)
    if shown is not None:
        excess, excess_sd = shown
        apparent = np.array([1.0, -1.0]) @ covariance
        variance = float(apparent @ [1.0, -1.0]) + excess_sd**2
        # What is seen narrows the spread; it is not corrected, and remains an error itself.
        square += (effects @ apparent / variance) ** 2 * (excess**2 - variance)
    return StatedSd(*np.sqrt(square).tolist())
