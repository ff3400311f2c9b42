"""The modes of reconstruction, and their measured accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from .trace import EFFORTS

PAPER, FULL, IN_PLACE = "paper", "full", "in-place"


@dataclass(frozen=True, slots=True)
class Mode:
    """Model and effort of a reconstruction.

    Attributes
    ----------
    model : str
        ``paper``, ``full`` or ``in-place``.
    effort : str
        One of `EFFORTS`; the paper's model has ``best`` only.
    """

    model: str = FULL
    effort: str = "fast"

    @property
    def label(self) -> str:
        """Name for the user."""
        names = {PAPER: "Paper's model", FULL: f"Full model, {self.effort}", IN_PLACE: "In place"}
        return names[self.model]


@dataclass(frozen=True, slots=True)
class ModeAccuracy:
    """Mean absolute errors over presses of known size.

    Attributes
    ----------
    height_percent : float
        Error of the plateau's height.
    size_percent : float
        Error of the size at half height.
    """

    height_percent: float
    size_percent: float


MODES = (*(Mode(FULL, effort) for effort in EFFORTS), Mode(PAPER, "best"))
"""All modes, the quickest of the full model first."""

MODES_OF: Mapping[str, tuple[Mode, ...]] = MappingProxyType(
    {FULL: MODES, PAPER: MODES[-1:], IN_PLACE: (Mode(IN_PLACE, "best"),)}
)
"""The modes that a calibration made for each model offers."""

FOUND: Mapping[Mode, ModeAccuracy] = MappingProxyType(
    {
        Mode(FULL, "fast"): ModeAccuracy(0.21, 0.32),
        Mode(FULL, "balanced"): ModeAccuracy(0.18, 0.16),
        Mode(FULL, "best"): ModeAccuracy(0.20, 0.10),
        Mode(PAPER, "best"): ModeAccuracy(2.0, 2.6),
    }
)
"""Measured on a matt sensor rendered at 50 dB by an independent path tracer and calibrated from its
images alone: eight presses, 3 to 7 mm wide and 0.5 to 1.5 mm deep."""
