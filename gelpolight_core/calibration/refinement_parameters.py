"""The parameters of the joint refinement, each one object, and their order in a vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum, auto
from functools import partial
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.leds.led_positions import LED_HEIGHT_SD_MM

from .ball_pixels import BallPixels

PRIOR_STRENGTH = 3.0
"""The loss forgives large deviations: what is known independently counts more."""
CURVE_COSINES = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Cosines of the one-dimensional membrane: cos times the exponential of a spline through these; it
is 0 at the last. Below the first, which balls hardly reach, it continues with Lambert's law."""
UNLIMITED = (-np.inf, np.inf)
MOST_OF_RADIUS = 0.95
"""Depth of a ball at most, in radii."""


class PriorSource(IntEnum):
    """Where a prior comes from. The residuals of priors are in this order."""

    MIRROR = auto()
    HOUSING = auto()
    USUAL_MEMBRANE = auto()
    WHITE_BOARD = auto()
    LAMBERT = auto()
    MOULD = auto()


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of a parameter beforehand.

    Attributes
    ----------
    mean : float or None
        Expected value. None: the start value.
    sd : float
        Standard deviation.
    source : PriorSource
        Where it comes from.
    strength : float
        Factor on the residual.
    """

    mean: float | None
    sd: float
    source: PriorSource
    strength: float = 1.0


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of the joint refinement.

    Attributes
    ----------
    key : str
        Name in files. Parameters with the same key belong to different channels or presses, so
        that no residual depends on two of them.
    name : str
        Display name.
    start : float
        Value at which a fit starts.
    limits : (float, float)
        Smallest and largest value.
    prior : Prior or None
        Knowledge beforehand.
    neutral : float
        Value without any effect.
    typical_change : float
        Change during a fit.
    free : bool
        Whether it is fitted.
    channel : int or None
        The only channel that it affects. None: all.
    press : int or None
        The only press that it affects, by its number. None: all.
    moves_surface : bool
        Whether rays meet the membrane elsewhere.
    """

    key: str
    name: str
    start: float
    limits: tuple[float, float] = UNLIMITED
    prior: Prior | None = None
    neutral: float = 0.0
    typical_change: float = 0.1
    free: bool = True
    channel: int | None = None
    press: int | None = None
    moves_surface: bool = False

    def fixed(self, value: float) -> Parameter:
        """Return the parameter at a value that is not fitted."""
        return replace(self, start=value, free=False)

    def used(self, used: bool) -> Parameter:
        """Return the parameter as it is, or fixed without any effect."""
        return self if used else self.fixed(self.neutral)


# Exponent and gloss trade off. Data that clearly show a diffuse share that deviates from Lambert's
# law are covered by the one-dimensional curves: the exponent is never fitted.
_LAMBERT = Prior(1.0, 0.01, PriorSource.USUAL_MEMBRANE, PRIOR_STRENGTH)
EXPONENT = Parameter("exponent", "exponent", 1.0, (0.5, 1.8), _LAMBERT, 1.0, free=False)
GLOSS = Parameter("gloss", "gloss", 0.05, (0.0, 0.9))
# Without gloss, any roughness is neutral.
_USUAL = Prior(0.5, 0.3, PriorSource.USUAL_MEMBRANE)
ROUGHNESS = Parameter("roughness", "roughness", 0.5, (0.15, 1.0), _USUAL, 0.5)
INTERREFLECTION = Parameter("interreflection", "interreflection", 0.1, (0.0, 1.5))
"""Reflectance for interreflected light."""
DECAY = Parameter(
    "decay_mm", "decay length", 0.7, (0.15, 3.0), typical_change=0.05, moves_surface=True
)
"""Decay length of the drape around a ball."""
MEMBRANE = (EXPONENT, GLOSS, ROUGHNESS, INTERREFLECTION, DECAY)
_of_mould = partial(Prior, 0.0, source=PriorSource.MOULD, strength=PRIOR_STRENGTH)
RISE_SD_MM, AXIS_SD_MM = 0.03, 0.05
"""Tolerance of a mould's height, and of its axis by the circle in the background."""
SHAPE = tuple(
    Parameter(key, name, 0.0, UNLIMITED, _of_mould(sd_mm), moves_surface=True)
    for key, name, sd_mm in (
        ("rise_mm", "height of the membrane", RISE_SD_MM),
        ("axis_x_mm", "axis of the membrane: x", AXIS_SD_MM),
        ("axis_y_mm", "axis of the membrane: y", AXIS_SD_MM),
    )
)
"""Rise of a curved membrane, and shift of its axis."""
_LATERAL = Prior(None, 0.05, PriorSource.MIRROR, PRIOR_STRENGTH)
_HEIGHT = Prior(None, LED_HEIGHT_SD_MM, PriorSource.HOUSING, PRIOR_STRENGTH)
LED_AXES = ("x", _LATERAL), ("y", _LATERAL), ("height", _HEIGHT)
_CURVE = Prior(0.0, 0.1, PriorSource.LAMBERT)
CURVES = tuple(
    Parameter(
        f"curve_{c:.1f}",
        f"reflectance of {name} at cosine {c:.1f}",
        0.0,
        prior=_CURVE,
        channel=k,
    )
    for k, name in enumerate(CHANNEL_KEYS)
    for c in CURVE_COSINES[:-1].tolist()
)
"""Spline heights of a one-dimensional membrane."""


class FitChoice(NamedTuple):
    """Which parameters a fit of presses has.

    Attributes
    ----------
    around : bool
        Whether there is interreflected light.
    refine : bool
        Whether LEDs, and the shape of a curved membrane, are fitted.
    curves : bool
        Whether the membrane is one-dimensional, without gloss.
    reflectance : (float, float) or None
        Reflectance for interreflected light that the white board lets expect, with its standard
        deviation.
    """

    around: bool
    refine: bool
    curves: bool = False
    reflectance: tuple[float, float] | None = None


def fit_parameters(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    leds_mm: Float64Array,
    choice: FitChoice,
) -> tuple[Parameter, ...]:
    """Return the parameters of a fit in their order, which :func:`unpacked` relies on.

    Parameters
    ----------
    presses, pixels : sequences of equal length
        The detected balls, and their pixels.
    leds_mm : (3, 3)
        LED positions from the mirror.
    choice : FitChoice
        Which parameters are fitted.
    """
    leds = [
        Parameter(f"led_{axis}_mm", f"{name} LED: {axis}", start_mm, prior=prior, channel=k)
        for k, (name, led_mm) in enumerate(zip(CHANNEL_KEYS, leds_mm.tolist(), strict=True))
        for (axis, prior), start_mm in zip(LED_AXES, led_mm, strict=True)
    ]
    shape, reflectance = SHAPE, choice.reflectance
    if not choice.refine:
        leds = [led.fixed(led.start) for led in leds]
    if not choice.refine or all(press.surface.flat for press in pixels):
        shape = tuple(replace(parameter.used(False), prior=None) for parameter in SHAPE)
    expected = None if reflectance is None else Prior(*reflectance, PriorSource.WHITE_BOARD)
    membrane = (
        EXPONENT,
        GLOSS.used(not choice.curves),
        ROUGHNESS.used(not choice.curves),
        replace(INTERREFLECTION.used(choice.around), prior=expected),
        DECAY,
    )
    pairs = enumerate(zip(presses, pixels, strict=True))
    balls = [ball for k, pair in pairs for ball in _ball_parameters(k, *pair)]
    return (*leds, *membrane, *shape, *balls, *(CURVES if choice.curves else ()))


def _ball_parameters(number: int, press: BallPress, pixels: BallPixels) -> list[Parameter]:
    """Return centre and depth of a ball, starting at the detected one."""
    max_depth_mm = MOST_OF_RADIUS * pixels.radius_mm
    depth_mm = float(np.clip(press.pose.depth_mm, 0.03, 0.9 * max_depth_mm))
    x_mm, y_mm = press.pose.centre_mm
    of_ball = partial(Parameter, press=number, moves_surface=True)
    depth = of_ball("ball_depth_mm", f"{press.name}: depth", start=depth_mm, typical_change=0.05)
    return [
        of_ball("ball_x_mm", f"{press.name}: x", start=x_mm, typical_change=0.02),
        of_ball("ball_y_mm", f"{press.name}: y", start=y_mm, typical_change=0.02),
        replace(depth, limits=(0.02, max_depth_mm)),
    ]


class ParameterValues(NamedTuple):
    """A vector of parameters by their meaning.

    Attributes
    ----------
    leds_mm : (3, 3)
        LED positions.
    lobes : (float, float, float)
        Exponent, gloss and roughness.
    interreflection : float
        Reflectance for interreflected light.
    decay_mm : float
        Decay length of the drape.
    shape_mm : (3,)
        Rise of the membrane at rest and shift of its axis.
    balls_mm : (N, 3)
        Centre and depth of each ball.
    curves : (3, M)
        Heights of the curves. M is 0 for a membrane with two lobes.
    """

    leds_mm: Float64Array
    lobes: tuple[float, float, float]
    interreflection: float
    decay_mm: float
    shape_mm: Float64Array
    balls_mm: Float64Array
    curves: Float64Array


def unpacked(x: Float64Array, balls: int) -> ParameterValues:
    """Return the values of a vector with the parameters of so many balls."""
    channels = len(CHANNEL_KEYS)
    sizes = 3 * channels, len(MEMBRANE), len(SHAPE), 3 * balls
    leds, membrane, shape, centres, curves = np.split(x, np.cumsum(sizes))
    exponent, gloss, roughness, interreflection, decay_mm = membrane.tolist()
    return ParameterValues(
        leds.reshape(channels, 3),
        (exponent, gloss, roughness),
        interreflection,
        decay_mm,
        shape,
        centres.reshape(balls, 3),
        curves.reshape(channels, -1),
    )
