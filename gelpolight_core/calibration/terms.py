"""The terms of the full model that are calibrated, each of which can be switched off."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CalibrationTerms:
    """The effects included in the joint refinement; by default all.

    A term that is switched off is fixed at its neutral value, and the rest is fitted again. The
    terms of a frame's reconstruction are in :class:`~gelpolight_core.reconstruction.terms.Terms`.

    Attributes
    ----------
    gloss : bool
        The membrane has a glossy lobe; otherwise it is diffuse only.
    curves : bool
        The membrane may be a one-dimensional curve for each channel, if two lobes do no better.
    interreflection : bool
        Interreflection: the membrane receives light from the membrane around it.
    crosstalk : bool
        Each LED's light is removed from the other channels; otherwise the raw channels are used.
    led_refinement : bool
        The LEDs are refined on the ball presses; otherwise they stay at the positions from the
        mirror.
    """

    gloss: bool = True
    curves: bool = True
    interreflection: bool = True
    crosstalk: bool = True
    led_refinement: bool = True


ALL_CALIBRATION_TERMS = CalibrationTerms()
