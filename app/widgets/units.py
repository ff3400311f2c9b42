"""Lengths in the preferred unit, and round lengths."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gelpolight_core.measurement.measured import Measured

LENGTH_UNITS = ("mm", "um")
_PER_MM = {"mm": 1.0, "um": 1e3}
_FEWER_DECIMALS = {"mm": 0, "um": 2}
"""An um has two decimals less than a mm: the third would be below any noise."""
_unit = "mm"


def use_length_unit(unit: str) -> None:
    """Show measured lengths in this unit from now on.

    Parameters
    ----------
    unit : str
        One of LENGTH_UNITS. Any other is ``mm``.
    """
    global _unit
    _unit = unit if unit in LENGTH_UNITS else "mm"


def length_unit() -> str:
    """Return the unit in use, one of LENGTH_UNITS."""
    return _unit


def unit_word() -> str:
    """Return the unit in use as text."""
    return "um" if _unit == "um" else "mm"


def per_mm() -> float:
    """Return how many of the unit in use make a mm."""
    return _PER_MM[_unit]


def in_unit(length_mm: float, *, decimals: int = 3, sign: str = "") -> str:
    """Return a length as text, with its unit.

    Parameters
    ----------
    length_mm : float
        The length.
    decimals : int, optional
        Decimals in mm.
    sign : str, optional
        ``+`` to write the sign of positive lengths.
    """
    digits = max(decimals - _FEWER_DECIMALS[_unit], 0)
    return f"{length_mm * per_mm():{sign}.{digits}f} {unit_word()}"


def figure_in_unit(figure: Measured) -> Measured:
    """Return a measured length of mm in the unit in use, anything else as it is."""
    if figure.unit != "mm" or _unit == "mm":
        return figure
    sd = None if figure.sd is None else figure.sd * per_mm()
    return replace(figure, value=figure.value * per_mm(), sd=sd, unit=_unit)


_STEPS = (1.0, 2.0, 5.0, 10.0)
_SLACK = 1e-9


def round_length_mm(largest_mm: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not longer. 0 if there is none."""
    if not (math.isfinite(largest_mm) and largest_mm > 0.0):
        return 0.0
    power = _power_of_ten(largest_mm)
    return max(k * power for k in _STEPS if k * power <= largest_mm * (1.0 + _SLACK))


def round_up(least: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is not smaller; 0 below 0."""
    if not (math.isfinite(least) and least > 0.0):
        return 0.0
    power = _power_of_ten(least)
    return min(k * power for k in _STEPS if k * power >= least * (1.0 - _SLACK))


def length_text(length_mm: float) -> str:
    """Return a length as text."""
    if length_mm < 0.1:
        return f"{round(1e3 * length_mm, 6):g} um"
    return f"{length_mm:g} mm"


def _power_of_ten(length_mm: float) -> float:
    """Return the power of ten of a length's first digit."""
    return float(10.0 ** math.floor(math.log10(length_mm) + _SLACK))
