"""Measured values as text, with no more digits than the standard deviation justifies."""

from __future__ import annotations

import math

from app.widgets.units import figure_in_unit
from gelpolight_core.measurement.measured import Measured

MOST_DECIMALS = 4
WITHOUT_SD = {"mm": 3, "um": 1, "deg": 2, "%": 2, "percent": 2}
UNITS = {"mm": " mm", "um": " \N{MICRO SIGN}m", "deg": "°", "%": " %", "percent": " %"}


def decimals_for(sd: float | None, unit: str) -> int:
    """Return the number of decimals of a value: two digits of its standard deviation."""
    usual = WITHOUT_SD.get(unit, 3)
    if sd is None or not math.isfinite(sd) or sd <= 0.0:
        return usual
    wanted = max(1 - math.floor(math.log10(sd)), 0)
    return wanted if wanted <= MOST_DECIMALS else usual


def unit_behind(unit: str) -> str:
    """Return a unit as text after a number."""
    return UNITS.get(unit, f" {unit}")


def unit_of(name: str) -> str:
    """Return the unit at the end of the name of a saved quantity: ``mm`` of ``diameter_mm``."""
    return name.rpartition("_")[2]


def value_text(value: float, sd: float | None, unit: str) -> str:
    """Return ``5.012 ± 0.024 mm``, or only the value if there is no standard deviation."""
    decimals = decimals_for(sd, unit)
    behind = unit_behind(unit)
    if not math.isfinite(value):
        return "unknown"
    number = f"{value:.{decimals}f}"
    if sd is None or not math.isfinite(sd):
        return f"{number}{behind}"
    smallest = 10.0**-decimals
    spread = f"{sd:.{decimals}f}" if sd >= 0.5 * smallest else f"<{smallest:.{decimals}f}"
    return f"{number} ± {spread}{behind}"


def figure_text(figure: Measured) -> str:
    """Return a figure as text, lengths in their readable unit."""
    figure = figure_in_unit(figure)
    return value_text(figure.value, figure.sd, figure.unit)
