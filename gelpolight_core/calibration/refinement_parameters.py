"""The parameters of the joint refinement: the terms of a sensor, and its balls.

A term (:class:`Term`) is a group of parameters that a sensor needs together or not at all. A vector
holds the parameters of the terms in use and of the balls, in any order; values are found by name.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.interpolate import CubicSpline

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.light.led_lobe import EXPONENT, LOBE, exponent_prior
from gelpolight_core.light.light_terms import LIGHT_TERMS, LightTerms
from gelpolight_core.light.membrane_brdf import CURVE_NODES, MembraneBrdf
from gelpolight_core.light.parameter import (
    UNLIMITED,
    Parameter,
    Prior,
    PriorSource,
    Term,
)
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.leds.led_positions import LED_HEIGHT_SD_MM

from .ball_pixels import BallPixels

CURVE_COSINES = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Cosines of the diffuse share: cos times the exponential of a spline through these; it is 0 at the
last. Below the first, which balls hardly reach, it continues with Lambert's law."""
MOST_OF_RADIUS = 0.95
"""Depth of a ball at most, in radii."""
GLOSS = Parameter(
    "gloss", "gloss", 0.05, (0.0, 0.9), figure="Glossy share of the membrane", warn=0.6
)
# Without gloss, any roughness is neutral.
_USUAL = Prior(0.5, 0.3, PriorSource.USUAL_MEMBRANE)
ROUGHNESS = Parameter("roughness", "roughness", 0.5, (0.15, 1.0), _USUAL, 0.5)
GLOSSY = Term("gloss", "gloss of the membrane", parameters=(GLOSS, ROUGHNESS))
INTERREFLECTION = Parameter(
    "interreflection",
    "reflectance for interreflected light",
    0.7,
    (0.0, 1.5),
    Prior(0.7, 0.2, PriorSource.USUAL_MEMBRANE),
    figure="Interreflection of the membrane",
    warn=1.2,
)
REFLECTING = Term(
    "interreflection", "light between parts of the membrane", parameters=(INTERREFLECTION,)
)
DECAY = Parameter(
    "decay_mm",
    "decay length",
    0.7,
    (0.15, 3.0),
    typical_change=0.05,
    moves_surface=True,
    figure="Decay length of the drape",
    unit="mm",
)
DRAPE = Term("drape", "drape around a ball", parameters=(DECAY,), always=True)
_of_mould = partial(Prior, 0.0, source=PriorSource.MOULD)
RISE_SD_MM, AXIS_SD_MM = 0.03, 0.05
"""Tolerance of a mould's height, and of its axis by the circle in the background."""
SHAPE_KEYS = "rise_mm", "axis_x_mm", "axis_y_mm"
SHAPE = Term(
    "shape",
    "shape of a curved membrane",
    parameters=tuple(
        Parameter(key, name, 0.0, UNLIMITED, _of_mould(sd_mm), moves_surface=True)
        for key, name, sd_mm in zip(
            SHAPE_KEYS,
            ("height of the membrane", "axis of the membrane: x", "axis of the membrane: y"),
            (RISE_SD_MM, AXIS_SD_MM, AXIS_SD_MM),
            strict=True,
        )
    ),
    always=True,
)
"""Rise of a curved membrane, and shift of its axis."""
_CURVE = Prior(0.0, 0.1, PriorSource.LAMBERT)
CURVED = Term(
    "curves",
    "diffuse share that deviates from Lambert's law",
    parameters=tuple(
        Parameter(
            f"curve_{c:.1f}",
            f"reflectance of {name} at cosine {c:.1f}",
            0.0,
            prior=_CURVE,
            channel=k,
        )
        for k, name in enumerate(CHANNEL_KEYS)
        for c in CURVE_COSINES[:-1].tolist()
    ),
)
"""Spline heights of the diffuse share of each channel."""
_LATERAL = Prior(None, 0.05, PriorSource.MIRROR)
_HEIGHT = Prior(None, LED_HEIGHT_SD_MM, PriorSource.HOUSING)
LED_AXES = {"led_x_mm": _LATERAL, "led_y_mm": _LATERAL, "led_height_mm": _HEIGHT}
LEDS = Term("leds", "positions of the LEDs")
"""Their parameters start at the positions from the mirror."""
TERMS: tuple[Term, ...] = (LEDS, GLOSSY, REFLECTING, CURVED, DRAPE, SHAPE, *LIGHT_TERMS)
"""All terms that a sensor may need."""
OPTIONAL = tuple(term.key for term in TERMS if not term.always)
"""Keys of the terms that held-out presses decide."""
LAMBERT = np.linspace(0.0, 1.0, CURVE_NODES)
"""The diffuse curve of Lambert's law."""


def spline_terms() -> Float64Array:
    """Return the spline's terms at even cosines, (`CURVE_NODES`, nodes - 1)."""
    even = np.clip(LAMBERT, CURVE_COSINES[0], 1.0)
    spline = CubicSpline(CURVE_COSINES, np.eye(CURVE_COSINES.size), bc_type="natural")
    return np.asarray(spline(even)[:, :-1])


BUMPS = spline_terms()


@dataclass(frozen=True, slots=True)
class KnownOfSensor:
    """What is known of a sensor before its ball presses.

    Attributes
    ----------
    leds_mm : (3, 3)
        LED positions from the mirror.
    reflectance : Prior or None
        Reflectance for interreflected light by the white board.
    half_angle_deg : float or None
        Half angle of the LEDs, from their data sheet.
    """

    leds_mm: Float64Array
    reflectance: Prior | None = None
    half_angle_deg: float | None = None


def terms_of_sensor(known: KnownOfSensor, used: Collection[str], *, flat: bool) -> list[Term]:
    """Return the terms in use with their parameters.

    Parameters
    ----------
    known : KnownOfSensor
        Gives start values and priors.
    used : collection of str
        Keys of the optional terms in use. The LEDs are always among the terms; they are fixed
        unless they are in use.
    flat : bool
        Whether the membrane is flat, without a shape to fit.
    """
    leds = tuple(
        Parameter(key, f"{name} LED: {key[4:-3]}", start_mm, prior=prior, channel=k)
        for k, (name, led_mm) in enumerate(zip(CHANNEL_KEYS, known.leds_mm.tolist(), strict=True))
        for (key, prior), start_mm in zip(LED_AXES.items(), led_mm, strict=True)
    )
    if LEDS.key not in used:
        leds = tuple(replace(led.fixed(led.start), prior=None) for led in leds)
    reflectance = known.reflectance or INTERREFLECTION.prior
    changed = {
        LEDS: leds,
        REFLECTING: (replace(INTERREFLECTION, prior=reflectance),),
        LOBE: (
            replace(EXPONENT, prior=exponent_prior(known.half_angle_deg)),
            *LOBE.parameters[1:],
        ),
    }
    return [
        replace(term, parameters=changed.get(term, term.parameters))
        for term in TERMS
        if term.key in used or term is LEDS or (term.always and not (flat and term is SHAPE))
    ]


def ball_parameters(
    presses: Sequence[BallPress], pixels: Sequence[BallPixels]
) -> tuple[Parameter, ...]:
    """Return centre and depth of each ball, starting at the detected one."""
    pairs = enumerate(zip(presses, pixels, strict=True))
    return tuple(one for number, pair in pairs for one in _of_ball(number, *pair))


def _of_ball(number: int, press: BallPress, pixels: BallPixels) -> list[Parameter]:
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


@dataclass(frozen=True)
class ParameterValues:
    """The values of parameters by their names.

    Attributes
    ----------
    shared : mapping
        Value of each parameter that all presses share, by its `full_key`. What is absent is
        neutral.
    balls_mm : (N, 3)
        Centre and depth of each ball.
    """

    shared: dict[str, float]
    balls_mm: Float64Array

    @classmethod
    def of(cls, parameters: Sequence[Parameter], x: Float64Array) -> ParameterValues:
        """Return the values of a vector (P,) of parameters."""
        pairs = list(zip(parameters, x.tolist(), strict=True))
        balls = [value for parameter, value in pairs if parameter.press is not None]
        shared = {p.full_key: value for p, value in pairs if p.press is None}
        return cls(shared, np.reshape(balls, (-1, 3)))

    @cached_property
    def leds_mm(self) -> Float64Array:
        """LED positions, (3, 3)."""
        return np.array([[self.shared[f"{key}_{k}"] for key in LED_AXES] for k in CHANNEL_KEYS])

    @cached_property
    def lobes(self) -> tuple[float, float, float]:
        """Exponent of the diffuse share, gloss and roughness."""
        of = self.shared.get
        return 1.0, of(GLOSS.key, GLOSS.neutral), of(ROUGHNESS.key, ROUGHNESS.neutral)

    @property
    def interreflection(self) -> float:
        """Reflectance for interreflected light."""
        return self.shared.get(INTERREFLECTION.key, INTERREFLECTION.neutral)

    @property
    def decay_mm(self) -> float:
        """Decay length of the drape."""
        return self.shared[DECAY.key]

    @cached_property
    def curves(self) -> Float64Array:
        """Heights of the curves, (3, M). M is 0 for Lambert's law."""
        heights = [self.shared[p.full_key] for p in CURVED.parameters if p.full_key in self.shared]
        return np.reshape(heights, (len(CHANNEL_KEYS), -1))

    @cached_property
    def terms(self) -> dict[str, float]:
        """Values of the terms of the light in use."""
        keys = (p.full_key for term in LIGHT_TERMS for p in term.parameters)
        return {key: self.shared[key] for key in keys if key in self.shared}

    @cached_property
    def light(self) -> LightTerms:
        """The terms of the light in use."""
        return LightTerms(self.terms)

    @cached_property
    def membrane(self) -> MembraneBrdf:
        """The light at the membrane."""
        diffuse: tuple[tuple[float, ...], ...] = ()
        if self.curves.size:
            bent = np.exp(self.curves @ BUMPS.T) * LAMBERT
            diffuse = tuple(tuple(np.maximum.accumulate(curve).tolist()) for curve in bent)
        return MembraneBrdf(*self.lobes, self.interreflection, diffuse, self.terms)

    def on(self, surface: MembraneShape) -> MembraneShape:
        """Return a membrane at rest with its rise and the shift of its axis."""
        if SHAPE_KEYS[0] not in self.shared:
            return surface
        rise, dx, dy = (self.shared[key] for key in SHAPE_KEYS)
        axis = surface.axis_mm[0] + dx, surface.axis_mm[1] + dy
        return replace(surface, rise_mm=surface.rise_mm + rise, axis_mm=axis)

    def poses(self, presses: Sequence[BallPixels]) -> tuple[BallPose, ...]:
        """Return the pose of each ball."""
        return tuple(
            BallPose((x_mm, y_mm), pixels.radius_mm, depth_mm)
            for (x_mm, y_mm, depth_mm), pixels in zip(self.balls_mm.tolist(), presses, strict=True)
        )
