"""The lobe of real LEDs: how fast their light falls off around an axis that may be tilted."""

from __future__ import annotations

from math import cos, log, radians, sin

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS

from .light_term import LightTerm
from .parameter import Parameter, Prior, PriorSource

LAMBERT_SD = 0.6
"""Of the exponent without a data sheet: LEDs have half angles from 47 to 80 degrees."""
HALF_ANGLE_SD_DEG = 5.0
"""Tolerance of a half angle in a data sheet."""
TILT_SD = 0.06
"""Of the slope of an LED's axis: it is soldered and cast within 3.4 degrees."""
LEAST_COSINE = 1e-3


def lobe_exponent(half_angle_deg: float) -> float:
    """Return the exponent of a lobe with half of its light at an angle to its axis.

    Examples
    --------
    >>> round(lobe_exponent(60.0), 6)
    1.0
    """
    return -log(2.0) / log(cos(radians(half_angle_deg)))


def exponent_prior(half_angle_deg: float | None) -> Prior:
    """Return what is known of the exponent, from the half angle of a data sheet if there is one."""
    if half_angle_deg is None:
        return Prior(1.0, LAMBERT_SD, PriorSource.DATA_SHEET)
    exponent, angle = lobe_exponent(half_angle_deg), radians(half_angle_deg)
    by_angle = exponent**2 / log(2.0) * sin(angle) / cos(angle)
    return Prior(exponent, by_angle * radians(HALF_ANGLE_SD_DEG), PriorSource.DATA_SHEET)


def _from_leds(
    values: Float64Array, leds_mm: Float64Array, points_mm: Float64Array
) -> Float64Array:
    """Return the light of lobes about their axes over the light of Lambertian LEDs along z."""
    exponent, tilts = values[0], values[1:].reshape(2, 3).T
    axes = np.concatenate([tilts, np.ones((3, 1))], axis=1)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    ray = np.asarray(points_mm)[..., None, :] - leds_mm
    ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    facing = np.maximum(np.einsum("...kc,kc->...k", ray, axes), LEAST_COSINE)
    return np.asarray(facing**exponent / np.maximum(ray[..., 2], LEAST_COSINE))


EXPONENT = Parameter(
    "lobe_exponent",
    "exponent of the LEDs' lobe",
    1.0,
    (0.2, 4.0),
    exponent_prior(None),
    neutral=1.0,
    figure="Exponent of the LEDs' lobe (1: Lambertian)",
)
_TILT = Prior(0.0, TILT_SD, PriorSource.DATA_SHEET)
_TILTS = tuple(
    Parameter(
        f"lobe_axis_{axis}",
        f"{name} LED: tilt along {axis}",
        0.0,
        (-0.3, 0.3),
        _TILT,
        typical_change=0.03,
        channel=k,
    )
    for axis in "xy"
    for k, name in enumerate(CHANNEL_KEYS)
)
LOBE = LightTerm("lobe", "lobe of the LEDs", parameters=(EXPONENT, *_TILTS), from_leds=_from_leds)
"""Intensity is the cosine to the axis, to the power of an exponent; axes are (x, y, 1)."""
