"""An effect on the light of a sensor, as a term of the joint refinement and of the solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gelpolight_core.base.arrays import Float64Array

from .parameter import Term


@dataclass(frozen=True, slots=True)
class LightTerm(Term):
    """An effect on the light at a place. Each function takes the values of its parameters first.

    Attributes
    ----------
    from_leds : callable, optional
        LED positions (3, 3) and points (..., 3), both in mm, to the factor (..., 3) on the light
        of each LED there.
    loss_per_mm : callable, optional
        Loss of light along a path through the gel, (3,): it falls by ``exp(-loss * path)``.
    reflectance : callable, optional
        Area of the stretched coating over its area at rest (...), to the factor (...) on its
        reflectance.
    """

    from_leds: Callable[[Float64Array, Float64Array, Float64Array], Float64Array] | None = None
    loss_per_mm: Callable[[Float64Array], Float64Array] | None = None
    reflectance: Callable[[Float64Array, Float64Array], Float64Array] | None = None
