"""The result of a health check: each fault with its cause and remedy in one line."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding
from gelpolight_core.image.bad_pixels import BadPixels


@dataclass(frozen=True, slots=True)
class LightGain:
    """Change of the LEDs' light or of the exposure since the calibration.

    Attributes
    ----------
    share : (3,) float64
        Light of each channel over that at calibration; an image is divided by it.
    sd : (3,) float64
        Standard deviations.
    shape : (6,) float64 or None
        Smooth change over the image, common to all channels, as factors of
        :func:`~gelpolight_core.health.health_samples.image_shapes`; None: the same everywhere.
    """

    share: NDArray[np.float64]
    sd: NDArray[np.float64]
    shape: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True)
class FrameHealth:
    """Faults of an image.

    Attributes
    ----------
    findings : tuple of Finding
        The worst first; empty where no fault was found.
    unknown : tuple of str
        Keys that could not be checked: too little of the membrane is untouched, or it shows no
        texture.
    untouched : float
        Share of the field that looks as at calibration, 0..1.
    cells : (cells, 3) or None
        Change of the light of each cell minus the common change; None if it is not known.
    light : LightGain or None
        Change of the light that is corrected; None if the light has not changed within its noise,
        or if the change cannot be corrected.
    bad : BadPixels or None
        Bad pixels of the image, which the depth leaves out; None where there are none.
    """

    findings: tuple[Finding, ...] = ()
    unknown: tuple[str, ...] = ()
    untouched: float = 1.0
    cells: NDArray[np.float64] | None = field(default=None, repr=False, compare=False)
    light: LightGain | None = field(default=None, compare=False)
    bad: BadPixels | None = field(default=None, repr=False, compare=False)

    @property
    def faults(self) -> tuple[Finding, ...]:
        """The findings that are not corrected in the depth."""
        return tuple(finding for finding in self.findings if finding.doubtful)

    @property
    def meaningless(self) -> Finding | None:
        """The first finding that makes the depth meaningless, or None."""
        return next((f for f in self.findings if f.meaningless), None)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of all findings."""
        return tuple(finding.key for finding in self.findings)


def refuse_meaningless(health: FrameHealth, *, where: str) -> None:
    """Refuse an image whose depth would be meaningless.

    Raises
    ------
    InputError
        With the fault's cause and remedy.
    """
    fault = health.meaningless
    if fault is not None:
        raise InputError(fault.text, where, fault.remedy)


def as_dict(finding: Finding) -> dict[str, Any]:
    """Return a fault as plain values for JSON."""
    return {
        "key": finding.key,
        "cause": finding.text,
        "remedy": finding.remedy,
        "severity": finding.verdict.value,
        "depth_is_meaningless": finding.meaningless,
        "value": finding.value if math.isfinite(finding.value) else 0.0,
        "unit": finding.unit,
        "corrected": not finding.doubtful,
    }
