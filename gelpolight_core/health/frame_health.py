"""The result of a health check: each fault with its cause and remedy in one line."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding
from gelpolight_core.base.membrane_masks import LEAST_LIGHT, saturated_mask
from gelpolight_core.image.bad_pixels import BadPixels

from .health_samples import light_over_image
from .row_light import RowLight


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
    rows : RowLight or None
        Change by row; None: none.
    mixing : (3, 3) float64 or None
        Colours over those at calibration as the camera mixes them; None: the same.
    tone : (2,) float64 or None
        Change of the light by its logarithm and by itself, as shares; None: none.
    """

    share: NDArray[np.float64]
    sd: NDArray[np.float64]
    shape: NDArray[np.float64] | None = None
    rows: RowLight | None = None
    mixing: NDArray[np.float64] | None = None
    tone: NDArray[np.float64] | None = None

    @property
    def is_even(self) -> bool:
        """Whether all pixels of a channel have changed alike."""
        return (
            self.shape is None and self.rows is None and self.mixing is None and self.tone is None
        )

    def evened(self, linear: Float32Array) -> Float32Array:
        """Return an image (height, width, 3) in linear light in which only `share` is left.

        Saturated pixels are kept.
        """
        light = linear
        if self.tone is not None:
            power, curve = self.tone.astype(np.float32)
            of_light = np.log(np.maximum(light, LEAST_LIGHT)) * power + light * curve
            light = light / (1.0 + of_light)
        if self.mixing is not None:
            unmixed = light @ np.linalg.inv(self.mixing).T.astype(np.float32)
            # A camera cuts off what mixing makes less than black: shadows stay dark.
            light = np.where(linear > 0.0, unmixed, np.float32(0.0))
        if self.shape is not None:
            light = light / light_over_image(self.shape, *light.shape[:2])[..., None]
        if self.rows is not None:
            light = light / self.rows.over_image()
        return np.where(saturated_mask(linear), linear, light)


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
