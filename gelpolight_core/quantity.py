"""A measured value beside its true value, without the numerical libraries."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quantity:
    """One measured value.

    Attributes
    ----------
    name : str
        Name with unit, such as ``diameter_mm``, ``height_mm`` or ``angle_deg``.
    value : float
        The measured value.
    sd : float or None
        Its standard deviation, if known.
    truth : float or None
        The true value, if known.
    limit_percent : float or None
        Largest error that passes, in percent of the truth.
    """

    name: str
    value: float
    sd: float | None = None
    truth: float | None = None
    limit_percent: float | None = None

    def __post_init__(self) -> None:
        """Refuse invalid numbers, and a true value of 0."""
        given = (self.value, self.sd, self.truth, self.limit_percent)
        if not all(number is None or math.isfinite(number) for number in given):
            raise ValueError(f"{self.name} holds a number that is not finite: {given}")
        if self.truth == 0.0:
            raise ValueError(f"{self.name} has a true value of 0")

    @property
    def unit(self) -> str:
        """The unit in its name."""
        return self.name.rpartition("_")[2]

    @property
    def error(self) -> float | None:
        """Measured minus true, in the quantity's unit."""
        return None if self.truth is None else self.value - self.truth

    @property
    def error_percent(self) -> float | None:
        """The error in percent of the truth."""
        return None if self.truth is None else percent_error(self.value, self.truth)

    @property
    def passed(self) -> bool | None:
        """Whether the error is within the limit; None without truth or limit."""
        if self.error_percent is None or self.limit_percent is None:
            return None
        return abs(self.error_percent) <= self.limit_percent


def percent_error(measured: float, true: float) -> float:
    """Return the signed error in percent of the true value."""
    return 100.0 * (measured / true - 1.0)
