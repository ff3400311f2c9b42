"""The terms of the full model's reconstruction, each of which can be left out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ModelTerms:
    """Effects that the full model includes in a frame, by default all.

    A term is switched off to measure its effect. Terms of the membrane and the LEDs belong to the
    calibration.

    Attributes
    ----------
    near_light_rounds : int
        Rounds at quarter scale, before the round at full scale. Each computes light directions,
        inverse square law and lobe again at the depth found. 0: they are computed for the flat
        membrane only.
    ray_true_slopes : bool
        Slopes are integrated along the refracted rays; otherwise along parallel rays.
    true_positions : bool
        Each depth is moved to the point where its ray meets the pressed membrane; otherwise it
        stays where the ray meets the flat membrane.
    shadows : bool
        A dark channel is left out; otherwise its value is used.
    saturation : bool
        A saturated channel is left out; otherwise its value is used.
    weights : bool
        Slopes are weighted by their reliability; otherwise all have the same weight, and one sine
        transform integrates them, with a fixed boundary.
    free_boundary : bool
        The boundary is free where a contact crosses it; otherwise the whole boundary is at depth 0.
    denoising : bool
        Uniform areas of the image are averaged over a few nodes.
    sharpening : bool
        The blur of the image is removed, to second order.
    """

    near_light_rounds: int = 2
    ray_true_slopes: bool = True
    true_positions: bool = True
    shadows: bool = True
    saturation: bool = True
    weights: bool = True
    free_boundary: bool = True
    denoising: bool = True
    sharpening: bool = True


ALL_TERMS = ModelTerms()
