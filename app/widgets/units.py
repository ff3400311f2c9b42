"""Lengths in a readable unit, and round lengths."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gelpolight_core.measurement.measured import Measured

SHORT_MM = 0.1
"""What is shorter is shown in um: the digits of its mm begin with zeros."""


def readable_unit(*lengths_mm: float) -> tuple[str, float]:
    """Return the unit in which the longest of some lengths is readable, and how many make a mm."""
    return ("um", 1e3) if max(map(abs, lengths_mm)) < SHORT_MM else ("mm", 1.0)


def in_unit(length_mm: float, *, sign: str = "") -> str:
    """Return a measured length as text, with its unit: to 1 um, or to 0.1 um if it is short.

    Parameters
    ----------
    length_mm : float
        The length.
    sign : str, optional
        ``+`` to write the sign of positive lengths.
    """
    unit, factor = readable_unit(length_mm)
    return f"{factor * length_mm:{sign}.{3 if unit == 'mm' else 1}f} {unit}"


def figure_in_unit(figure: Measured) -> Measured:
    """Return a measured length of mm in its readable unit, anything else as it is."""
    if figure.unit != "mm":
        return figure
    unit, factor = readable_unit(figure.value, figure.sd or 0.0)
    sd = None if figure.sd is None else factor * figure.sd
    return replace(figure, value=factor * figure.value, sd=sd, unit=unit)


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
    """Return a round length as text."""
    unit, factor = readable_unit(length_mm)
    return f"{round(factor * length_mm, 6):g} {unit}"


def _power_of_ten(length_mm: float) -> float:
    """Return the power of ten of a length's first digit."""
    return float(10.0 ** math.floor(math.log10(length_mm) + _SLACK))
