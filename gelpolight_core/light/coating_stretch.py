"""Loss of the coating's reflectance where it is stretched.

A coating keeps its amount of pigment on a larger area. Its reflectance falls in proportion to the
area that it gains, as the first term of any law in the area does; balls show walls of up to 60
degrees, the law continues beyond them.
"""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .light_term import LightTerm
from .parameter import Parameter, Prior, PriorSource

LEAST_REFLECTANCE = 0.3
"""A stretched coating keeps at least this share: the law says nothing beyond."""


def stretched_reflectance(loss: float, area: Float64Array) -> Float64Array:
    """Return the factor on the reflectance of a coating stretched to (...) times its area.

    Examples
    --------
    >>> stretched_reflectance(0.1, np.array([1.0, 2.0]))
    array([1. , 0.9])
    """
    return np.maximum(1.0 - loss * (area - 1.0), LEAST_REFLECTANCE)


def _reflectance(values: Float64Array, area: Float64Array) -> Float64Array:
    return stretched_reflectance(float(values[0]), area)


LOSS = Parameter(
    "stretch_loss",
    "loss of reflectance with stretch",
    0.0,
    (-0.3, 1.0),
    Prior(0.0, 0.15, PriorSource.USUAL_MEMBRANE),
    typical_change=0.03,
    figure="Loss of reflectance of the coating at twice its area",
)
STRETCH = LightTerm(
    "stretch", "coating darker where it is stretched", parameters=(LOSS,), reflectance=_reflectance
)
