"""Round lengths."""

from __future__ import annotations

import math

from gelpolight_core.base.compared_quantity import readable_unit, unit_behind

_STEPS = (1.0, 2.0, 5.0, 10.0)
_SLACK = 1e-9


def round_length_mm(largest_mm: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not longer. 0 if there is none."""
    if not (math.isfinite(largest_mm) and largest_mm > 0.0):
        return 0.0
    power = _power_of_ten(largest_mm)
    return max(k * power for k in _STEPS if k * power <= largest_mm * (1.0 + _SLACK))


def round_up(least: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is not smaller, or 0 below 0."""
    if not (math.isfinite(least) and least > 0.0):
        return 0.0
    power = _power_of_ten(least)
    return min(k * power for k in _STEPS if k * power >= least * (1.0 - _SLACK))


def length_text(length_mm: float) -> str:
    """Return a round length as text."""
    unit, factor = readable_unit(length_mm)
    return f"{round(factor * length_mm, 6):g}{unit_behind(unit)}"


def _power_of_ten(length_mm: float) -> float:
    """Return the power of ten of a length's first digit."""
    return float(10.0 ** math.floor(math.log10(length_mm) + _SLACK))
