"""The drape: the membrane around a pressed object, as a tense sheet on an elastic foundation.

Where it is free, ``decay^2 laplacian(w) = w``: around a round contact, w falls as K0(r / decay). It
leaves the object tangentially.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.special import k0e, k1e

from gelpolight_core.base.arrays import Float64Array

TYPICAL_DECAY_MM = 0.7
"""Decay length of a membrane for which it is not known."""
STEEPEST = 0.98
"""Share of a ball's radius up to which the membrane may follow it."""


def round_steepness(radius_mm: float, decay_mm: float) -> float:
    """Return -w'/w of the round drape, K1 / K0 / decay, in 1/mm."""
    q = max(radius_mm / decay_mm, 1e-12)
    return float(k1e(q) / k0e(q)) / decay_mm


def round_drape(
    radius_mm: Float64Array, contact_mm: Float64Array | float, decay_mm: float
) -> Float64Array:
    """Return K0(r / decay) / K0(a / decay) without underflow, 1 inside the contact."""
    contact = np.maximum(contact_mm / decay_mm, 1e-12)
    q = np.maximum(radius_mm / decay_mm, contact)
    return np.asarray(k0e(q) / k0e(contact) * np.exp(contact - q))


def ball_depth_from_contact(contact_mm: float, radius_mm: float) -> float:
    """Return the depth of a pressed ball from its contact radius.

    Eq. (8) gives the height of the contact ring above the ball's lowest point. The ring itself is
    below the undeformed surface, because the membrane leaves the ball tangentially.

    Parameters
    ----------
    contact_mm, radius_mm : float
        Radii of the contact and of the ball.
    """
    a = min(contact_mm, STEEPEST * radius_mm)
    to_centre = math.sqrt(radius_mm**2 - a**2)
    return radius_mm - to_centre + a / to_centre / round_steepness(a, TYPICAL_DECAY_MM)


def ball_contact_from_depth(depth_mm: float, radius_mm: float, *, decay_mm: float) -> float:
    """Return the radius at which the membrane leaves a ball: where the two slopes are equal.

    Parameters
    ----------
    depth_mm, radius_mm : float
        How deep the ball is pressed, and its radius.
    decay_mm : float
        Decay length of the membrane.
    """

    def excess(angle: float) -> float:
        depth = depth_mm - radius_mm * (1.0 - math.cos(angle))
        steepness = round_steepness(radius_mm * math.sin(angle), decay_mm)
        return math.sin(angle) - math.cos(angle) * depth * steepness

    return radius_mm * math.sin(leaving_angle(excess, 1e-9))


def leaving_angle(excess: Callable[[float], float], low: float) -> float:
    """Return the angle up to a right one at which a function changes its sign (Illinois method)."""
    other, angle = low, math.pi / 2.0
    f_other, f = excess(other), excess(angle)
    while f != 0.0 and abs(step := f * (angle - other) / (f - f_other)) > 1e-12:
        f_new = excess(angle - step)
        # The older end stays where it is needed to enclose the root, with half of its weight.
        other, f_other = (angle, f) if f_new * f < 0.0 else (other, 0.5 * f_other)
        angle, f = angle - step, f_new
    return angle
