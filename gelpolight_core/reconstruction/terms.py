"""The terms of the full model's reconstruction, each of which can be left out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Terms:
    """What the full model reckons with in a frame; by default everything.

    Leaving a term out shows what it is worth. Terms of the membrane and the LEDs are made at
    calibration (:class:`~gelpolight_core.calibration.terms.CalibrationTerms`).

    Attributes
    ----------
    near_light_rounds : int
        Rounds at quarter scale in which light, inverse square and lobe are computed again at the
        depth found, before the round at full scale; 0: the light is frozen at the flat membrane.
    ray_true_slopes : bool
        Slopes are integrated along the refracted rays; else as if all rays ran straight down.
    true_positions : bool
        The depth is brought to where the rays meet the pressed membrane; else it stays where they
        met the flat one.
    shadows : bool
        A dark channel is missing information; else its value is believed.
    saturation : bool
        A saturated channel is missing information; else its value is believed.
    weights : bool
        Slopes count as far as they can be trusted; else all alike, by one sine transform, which
        cannot free the boundary either.
    free_rim : bool
        The boundary is free where a contact crosses it; else depth 0 is held all around.
    denoising : bool
        Even parts of the image are averaged over a few nodes.
    sharpening : bool
        The blur of the image is undone, to first order.
    """

    near_light_rounds: int = 2
    ray_true_slopes: bool = True
    true_positions: bool = True
    shadows: bool = True
    saturation: bool = True
    weights: bool = True
    free_rim: bool = True
    denoising: bool = True
    sharpening: bool = True


ALL_TERMS = Terms()
