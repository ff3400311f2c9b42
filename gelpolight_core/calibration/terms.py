"""The terms of the full model that are made at calibration, each of which can be left out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CalibrationTerms:
    """What the joint refinement reckons with; by default everything.

    What is left out is held at its neutral value and the rest is fitted anew. The terms of a
    frame's reconstruction are in :class:`~gelpolight_core.reconstruction.terms.Terms`.

    Attributes
    ----------
    gloss : bool
        The membrane has a glossy lobe; else it is diffuse only.
    curves : bool
        The membrane may be a one-dimensional curve for each channel, where two lobes do no better.
    bounce : bool
        The membrane receives light from the membrane around it.
    crosstalk : bool
        Each LED's light is removed from the other channels; else the raw channels are believed.
    led_refinement : bool
        The LEDs are refined on the ball presses; else they stay where the mirror shows them.
    """

    gloss: bool = True
    curves: bool = True
    bounce: bool = True
    crosstalk: bool = True
    led_refinement: bool = True


ALL_CALIBRATION_TERMS = CalibrationTerms()
