"""Joint refinement of LEDs, balls and membrane on the ball presses.

Press over background cancels light intensity and reflectance factor, so the ratio depends only on
geometry and on the membrane's response. Both the balls and the drape around them are used: the
drape is concave, like the walls around pressed objects, and receives light from its surroundings
that a ball's cap does not receive. The LED positions from the mirror and Z1 from the housing are
priors.

Two membranes are tested: one with two lobes, whose brightness depends on the viewing direction, and
the paper's one-dimensional curve of the cosine to the light for each channel (Eq. 6). Held-out
presses decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.least_squares import fit_least_squares
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.light.facet_interreflection import Slab
from gelpolight_core.light.membrane_brdf import MEMBRANES, MembraneBrdf
from gelpolight_core.sensor.sensor_calibration import FullModel
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.balls.press_agreement import LEAST_PRESSES

from .ball_pixels import BallPixels, add_ball_interreflection, every_second_pixel
from .board_ratio import MembraneBoardRatio
from .conditioning import ParameterConditioning, shared_covariance
from .refinement_kernel import CORRELATION
from .refinement_parameters import MEMBRANE, FitChoice, Parameter, ParameterValues, fit_parameters
from .refinement_problem import (
    LAMBERT,
    STATED,
    JointProblem,
    ball_poses,
    with_shape_parameters,
    with_spline_offsets,
)

SIGNIFICANT = 3.0
"""Interreflection counts as present above this many standard deviations."""
STATED_RANGE, STATED_STEP, STATED_CHANGE = (0.4, 2.5), 1e-4, 0.05
"""Limits of the factor on a stated length, its step for derivatives, which is also the tolerance of
its fit, and its typical change."""


class StatedLengthFit(NamedTuple):
    """A stated length, or the evenness of the coating, as the presses show it.

    Attributes
    ----------
    key : str
        One of `STATED`.
    value, sd : float
        Factor on the length that fits best, with its standard deviation; for the coating 1 plus its
        exponent.
    chi_square : float
        What is left then; large residuals count less.
    """

    key: str
    value: float
    sd: float
    chi_square: float


@dataclass(frozen=True, slots=True)
class JointRefinement:
    """LEDs, membrane and balls that fit all presses together.

    Attributes
    ----------
    full : FullModel
        LEDs, membrane and drape, without the uncertainty of lengths.
    balls : tuple of BallPose
        Refined.
    ball_misfits : (balls,)
        Robust relative misfit of each press; NaN if it has no usable pixels.
    ball_names : tuple of str
        Names of these presses.
    shared : tuple of Parameter
        The S parameters that all presses share.
    shared_values : (S,)
        Their fitted values.
    covariance : (S, S)
        Covariance of the shared parameters, from leaving out one press at a time. 0 for fixed ones.
    determined : ParameterConditioning
        How well the presses determine these parameters.
    surface : MembraneShape
        The membrane at rest, refined if it is curved.
    stated : tuple of StatedLengthFit
        What contradicts the presses, the most likely first. Empty if it was not looked for.
    """

    full: FullModel
    balls: tuple[BallPose, ...]
    ball_misfits: Float64Array
    ball_names: tuple[str, ...]
    shared: tuple[Parameter, ...]
    shared_values: Float64Array
    covariance: Float64Array
    determined: ParameterConditioning
    surface: MembraneShape
    stated: tuple[StatedLengthFit, ...] = ()


def refine_jointly(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    led_positions_mm: Float64Array,
    slab: Slab,
    background: Float32Array,
    *,
    board: MembraneBoardRatio | None = None,
    bright_mm: Float64Array | None = None,
) -> JointRefinement:
    """Refine LEDs, membrane and balls together.

    The LEDs from the mirror are kept if they fit held-out presses better, and the membrane is
    one-dimensional if two lobes do no better.

    Parameters
    ----------
    presses, pixels : sequences of equal length
        The detected balls, and their pixels.
    led_positions_mm : (3, 3)
        From the mirror spots.
    slab : Slab
        What is below the membrane.
    background : (rows, columns, 3) float32
        The contact-free membrane, which the full model holds.
    board : MembraneBoardRatio, optional
        The untouched membrane and the white board, which give the reflectance.
    bright_mm : (3, 2), optional
        Where the LEDs are seen in the mirror. With it and four presses or more, the fit looks for
        stated lengths that contradict the presses.
    """
    lit = _first_light(presses, pixels, led_positions_mm, slab)
    # Without interreflection, no frame needs to compute it.
    around = lit is not None
    pixels = pixels if lit is None else lit
    held_out, membranes = _held_out(presses, pixels, led_positions_mm, around)
    refine = held_out[1] <= held_out[0]
    curves = membranes[1] <= membranes[0]
    choice = FitChoice(around, refine, curves)
    solved = _solve(presses, pixels, led_positions_mm, choice)
    if around:
        pixels = _lit(pixels, solved.values, slab)
        expected = None if board is None else _expected(board, solved)
        choice = choice._replace(reflectance=expected)
        solved = _solve(presses, pixels, led_positions_mm, choice, near=solved.x)
    problem, values = solved.problem, solved.values
    sd = problem.values(solved.sd)
    sd_by_key = {p.key: float(s) for p, s in zip(problem.parameters, solved.sd, strict=True)}
    full = FullModel(
        led_positions_mm=values.leds_mm,
        led_sd_mm=sd.leds_mm,
        membrane=_membrane_of(values),
        background=background,
        decay_mm=values.decay_mm,
        misfit=solved.misfit,
        held_out=held_out,
        kept="refined" if refine else "mirror",
        membrane_sd={parameter.key: sd_by_key[parameter.key] for parameter in MEMBRANE},
        membrane_held_out=membranes,
        membrane_kept=MEMBRANES[int(curves)],
    )
    shared, covariance, conditioning = shared_covariance(problem, solved.x)
    return JointRefinement(
        full,
        ball_poses(values, pixels),
        solved.ball_misfits,
        tuple(press.name for press in presses),
        shared,
        solved.x[problem.shared],
        covariance,
        conditioning,
        with_shape_parameters(pixels[0].surface, values.shape_mm),
        () if bright_mm is None or len(presses) < LEAST_PRESSES else _compared(solved, bright_mm),
    )


def _membrane_of(values: ParameterValues) -> MembraneBrdf:
    if values.curves.size:
        diffuse = with_spline_offsets(LAMBERT, values.curves)
        return MembraneBrdf(interreflection=values.interreflection, diffuse=diffuse)
    return MembraneBrdf(*values.lobes, values.interreflection)


def _expected(board: MembraneBoardRatio, solved: _JointSolution) -> tuple[float, float] | None:
    """Return the reflectance expected from the white board with its standard deviation."""
    values, sd = solved.values, solved.problem.values(solved.sd)
    measured = values.interreflection, sd.interreflection
    return board.expected(values.leds_mm, _membrane_of(values), measured)


def _lit(pixels: Sequence[BallPixels], values: ParameterValues, slab: Slab) -> list[BallPixels]:
    """Return the pixels with the interreflected light of a solution."""
    balls, membrane = ball_poses(values, pixels), _membrane_of(values)
    return add_ball_interreflection(pixels, balls, values.decay_mm, values.leds_mm, membrane, slab)


def _first_light(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    leds: Float64Array,
    slab: Slab,
) -> list[BallPixels] | None:
    """Return the pixels with interreflected light from a first fit, or None if there is none.

    The fit starts from the light that a matt membrane would reflect.
    """
    choice = FitChoice(around=True, refine=True)
    problem = JointProblem(pixels, fit_parameters(presses, pixels, leds, choice))
    some = _lit([every_second_pixel(p) for p in pixels], problem.values(problem.start), slab)
    solved = _solve(presses, some, leds, choice)
    values, sd = solved.values, solved.problem.values(solved.sd)
    if values.interreflection <= SIGNIFICANT * sd.interreflection:
        return None
    return _lit(pixels, values, slab)


@dataclass(frozen=True, slots=True)
class _JointSolution:
    """Solution of a fit: parameters with standard deviations, misfits and mean loss."""

    x: Float64Array
    sd: Float64Array
    misfit: float
    ball_misfits: Float64Array
    loss: float
    problem: JointProblem

    @property
    def values(self) -> ParameterValues:
        """The parameters by their meaning."""
        return self.problem.values(self.x)


def _solve(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    leds: Float64Array,
    choice: FitChoice,
    *,
    judging: Float64Array | None = None,
    near: Float64Array | None = None,
) -> _JointSolution:
    """Solve for all parameters, starting from a solution that is `near`, if there is one.

    When `judging` a fit to other presses, by its shared parameters, solve for the balls alone.
    """
    if judging is None:
        problem = JointProblem(pixels, fit_parameters(presses, pixels, leds, choice))
    else:
        choice = choice._replace(refine=False)
        problem = JointProblem(pixels, fit_parameters(presses, pixels, leds, choice)).judging(
            judging
        )
    free, (low, high) = problem.free, problem.limits
    begin = problem.start if near is None else near

    def whole(part: Float64Array) -> Float64Array:
        x = problem.start.copy()
        x[free] = part
        return x

    fit = fit_least_squares(
        lambda part: problem.all(whole(part)),
        lambda part: problem.jacobian(whole(part))[:, free],
        begin[free],
        (low[free], high[free]),
        scale=problem.typical_change[free],
        robust=True,
    )
    return _described(problem, whole(fit.x))


def _compared(solved: _JointSolution, bright_mm: Float64Array) -> tuple[StatedLengthFit, ...]:
    """Return what of `STATED` contradicts the presses, the one that explains most first.

    To first order, balls of another radius, a membrane of another reflectance, other layers and
    LEDs at another height look alike. The curvature of the brightness across a contact, and presses
    at other places, tell them apart. Each is fitted with all other parameters.
    """
    problem = replace(
        solved.problem,
        presses=[every_second_pixel(every_second_pixel(p)) for p in solved.problem.presses],
    )
    free, (low, high), scale = problem.free, problem.limits, problem.typical_change

    def fitted(key: str) -> StatedLengthFit:
        def at(part: Float64Array) -> tuple[JointProblem, Float64Array]:
            changed, x = problem.with_stated(key, part[-1], bright_mm), solved.x.copy()
            x[free] = part[:-1]
            x += changed.start - problem.start
            return changed, x

        def residuals(part: Float64Array) -> Float64Array:
            changed, x = at(part)
            return changed.all(x)

        def jacobian(part: Float64Array) -> Float64Array:
            changed, x = at(part)
            more = part + STATED_STEP * (np.arange(part.size) == part.size - 1)
            by_value = (residuals(more) - residuals(part)) / STATED_STEP
            return np.column_stack([changed.jacobian(x)[:, free], by_value])

        solution = fit_least_squares(
            residuals,
            jacobian,
            np.append(solved.x[free], 1.0),
            (np.append(low[free], STATED_RANGE[0]), np.append(high[free], STATED_RANGE[1])),
            scale=np.append(scale[free], STATED_CHANGE),
            robust=True,
            tolerance=STATED_STEP,
        ).x
        slopes = jacobian(solution)
        sd = float(np.sqrt(np.linalg.pinv(slopes.T @ slopes)[-1, -1]))
        chi_square = float(2.0 * (np.sqrt(1.0 + residuals(solution) ** 2) - 1.0).sum())
        return StatedLengthFit(key, float(solution[-1]), sd, chi_square)

    # The height of a curved membrane is refined in any case.
    keys = [key for key in STATED if key != "membrane" or problem.presses[0].surface.flat]
    return tuple(sorted(in_parallel(fitted, keys), key=lambda one: one.chi_square))


def _described(problem: JointProblem, x: Float64Array) -> _JointSolution:
    """Return a solution with its standard deviations, misfits and loss."""
    residuals = problem.residuals(x)
    weights = [p.weight.ravel() for p in problem.presses]
    scaled = np.concatenate(residuals)
    loss = float(np.mean(np.sqrt(1.0 + scaled**2) - 1.0))
    misfit = _relative_misfit(scaled, np.concatenate(weights))
    of_balls = [_relative_misfit(r, w) for r, w in zip(residuals, weights, strict=True)]
    curvature = problem.jacobian(x)[:, problem.free]
    variance = np.diag(np.linalg.pinv(curvature.T @ curvature))
    sd = np.zeros(x.size)
    sd[problem.free] = np.sqrt(np.maximum(variance, 0.0))
    return _JointSolution(x, sd, misfit, np.array(of_balls), loss, problem)


def _relative_misfit(scaled: Float64Array, weight: Float64Array) -> float:
    """Return the robust misfit of the ratio, or NaN if no pixel is usable."""
    valid_mask = (weight > 0.0) & (scaled != 0.0)
    if not valid_mask.any():
        return float("nan")
    return robust_sd(CORRELATION * scaled[valid_mask] / weight[valid_mask])


def _held_out(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    leds: Float64Array,
    around: bool,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return mean robust losses on every second press, from fits to the others.

    First with the LEDs from the mirror and with refined ones; then, with the better of these, with
    the two-lobe membrane and with the one-dimensional one.
    """
    even, odd = slice(0, None, 2), slice(1, None, 2)
    if len(presses) < 4:
        # Too few presses to hold any out: keep the LEDs from the mirror, and the form that
        # extrapolates better.
        return (0.0, 1.0), (0.0, 1.0)
    # Half of the pixels are enough to decide which of two fits is better.
    pixels = [every_second_pixel(p) for p in pixels]

    def loss(refine: bool, curves: bool) -> float:
        choice = FitChoice(around, refine, curves)
        fit = _solve(presses[even], pixels[even], leds, choice)
        shared = fit.x[fit.problem.shared]
        return _solve(presses[odd], pixels[odd], leds, choice, judging=shared).loss

    mirror, refined = in_parallel(lambda refine: loss(refine, False), (False, True))
    one_dimensional = loss(refined <= mirror, True)
    return (mirror, refined), (min(mirror, refined), one_dimensional)
