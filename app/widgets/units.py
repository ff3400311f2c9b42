"""The unit in which measured lengths and depths are shown. Files, records and inputs keep mm."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from gelpolight_core.translation import tr

if TYPE_CHECKING:
    # The window opens before the numerical libraries are loaded.
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
    return tr("um") if _unit == "um" else tr("mm")


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
