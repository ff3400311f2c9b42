"""Joint refinement of LEDs, balls and membrane on the ball presses.

Press over background cancels light intensity and reflectance factor, so the ratio depends only on
geometry and on the membrane's response. Both the balls and the drape around them are used: the
drape is concave, like the walls around pressed objects, and receives light from its surroundings
that a ball's cap does not receive. The LED positions from the mirror, Z1 from the housing, the
membrane's reflectance from the white board and data sheets are priors.

A sensor has the terms that held-out presses ask for: a gloss, whose brightness depends on the
viewing direction, curves of the cosine to the light for each channel (Eq. 6), interreflected light,
and what changes the light of real LEDs, gels and coatings.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.least_squares import fit_least_squares
from gelpolight_core.base.robust import robust_sd
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.light.facet_interreflection import Slab
from gelpolight_core.light.light_terms import LIGHT_TERMS
from gelpolight_core.light.parameter import Parameter
from gelpolight_core.sensor.sensor_calibration import FullModel
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.ball_press import BallPress
from gelpolight_core.stages.balls.press_agreement import LEAST_PRESSES

from .ball_pixels import BallPixels, add_ball_interreflection, every_second_pixel
from .board_light import BoardLight
from .conditioning import ParameterConditioning, shared_covariance
from .refinement_kernel import CORRELATION
from .refinement_parameters import (
    CURVED,
    GLOSSY,
    LEDS,
    OPTIONAL,
    REFLECTING,
    KnownOfSensor,
    ParameterValues,
    ball_parameters,
    terms_of_sensor,
)
from .refinement_problem import BLENDED, STATED, JointProblem
from .term_selection import LinearTerms, TermEvidence, compared, needed_terms, used_of

CLEAR = 9.0
"""Fall of chi square by which a cause is more likely than another one: 3 standard deviations."""
ODD_SDS = 3.0
"""Standard deviations from which on a ball is odd."""
MEDIAN_OF_SQUARE = 0.455
"""Of the square of a normally distributed number."""


class StatedLengthFit(NamedTuple):
    """A stated length as the presses show it.

    Attributes
    ----------
    key : str
        One of `STATED`, or ``ball`` with the name of one press.
    value, sd : float
        Factor on the length that fits best, with its standard deviation.
    chi_square : float
        What is left then; large residuals count less.
    asked : bool
        Whether held-out presses ask for it.
    """

    key: str
    value: float
    sd: float
    chi_square: float
    asked: bool = False

    @property
    def unlikely(self) -> float:
        """What is left, less a clear fall where held-out presses ask for it.

        A length is stated wrongly more often than a camera blends its frames.
        """
        return self.chi_square - CLEAR * (self.asked and self.key != BLENDED)


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
    evidence : mapping
        What held-out presses say of each optional term, by its key.
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
    evidence: Mapping[str, TermEvidence]
    stated: tuple[StatedLengthFit, ...] = ()


def refine_jointly(
    presses: Sequence[BallPress],
    pixels: Sequence[BallPixels],
    led_positions_mm: Float64Array,
    slab: Slab,
    background: Float32Array,
    *,
    board: BoardLight | None = None,
    half_angle_deg: float | None = None,
    bright_mm: Float64Array | None = None,
) -> JointRefinement:
    """Refine LEDs, membrane and balls together, with the terms that the sensor needs.

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
    board : BoardLight, optional
        The white board.
    half_angle_deg : float, optional
        Of the LEDs, from their data sheet.
    bright_mm : (3, 2), optional
        Where the LEDs are seen in the mirror. With it and four presses or more, the fit looks for
        stated lengths that contradict the presses.
    """
    shows = bright_mm if len(presses) >= LEAST_PRESSES else None
    known = KnownOfSensor(led_positions_mm, None, half_angle_deg)
    sensor = _Sensor(presses, known, slab, board, shows)
    # Every fourth pixel is enough to decide what a sensor needs.
    some = [every_second_pixel(every_second_pixel(p)) for p in pixels]
    solved, evidence = sensor.needed(some)
    used, asked = used_of(evidence) & {*OPTIONAL}, used_of(evidence) - {*OPTIONAL}
    solved = sensor.solved(pixels, used, near=solved.values)
    problem, values = solved.problem, solved.values
    sd = dict(zip((p.full_key for p in problem.parameters), solved.sd.tolist(), strict=True))
    led_sd_mm = np.array([sd[p.full_key] for p in problem.parameters[: led_positions_mm.size]])
    shared, covariance, conditioning = shared_covariance(problem, solved.x)
    full = FullModel(
        led_positions_mm=values.leds_mm,
        led_sd_mm=led_sd_mm.reshape(led_positions_mm.shape),
        membrane=values.membrane,
        background=background,
        decay_mm=values.decay_mm,
        misfit=solved.misfit,
        kept="refined" if LEDS.key in used else "mirror",
        membrane_sd={p.full_key: sd[p.full_key] for p in shared[led_positions_mm.size :]},
        worth={key: evidence[key].worth for key in OPTIONAL if key in evidence},
    )
    return JointRefinement(
        full,
        values.poses(pixels),
        solved.ball_misfits,
        tuple(press.name for press in presses),
        shared,
        solved.x[problem.shared],
        covariance,
        conditioning,
        values.on(pixels[0].surface),
        evidence,
        () if shows is None else sensor.contradictions(solved, used, asked),
    )


@dataclass(frozen=True, slots=True)
class _Sensor:
    """What stays the same in all fits of a sensor: its presses, and what is known beforehand."""

    presses: Sequence[BallPress]
    known: KnownOfSensor
    slab: Slab
    board: BoardLight | None
    bright_mm: Float64Array | None

    def needed(
        self, pixels: Sequence[BallPixels]
    ) -> tuple[_JointSolution, dict[str, TermEvidence]]:
        """Return a solution with all terms, and what held-out presses say of each.

        A membrane has a gloss, or the paper's curves of the cosine if these fit clearly better:
        together they take up each other's errors.
        """
        start, known = self.by_board(), OPTIONAL
        if self.board is not None and not self.board.separated:
            # Crosstalk that is not known looks like any of them.
            known = tuple(key for key in OPTIONAL if key not in {term.key for term in LIGHT_TERMS})
        choice = [key for key in known if key != CURVED.key]
        glossy = self.solved(pixels, choice, near=start)
        whole = self._problem(glossy.problem.presses, known, self.board, glossy.values)
        linear = LinearTerms(whole, _nearest(whole, glossy.values))
        found = needed_terms(linear, choice)
        curves = linear.evidence(CURVED.key, used_of(found))
        if not curves.sure:
            return glossy, {**found, CURVED.key: curves}
        choice = [key for key in known if key != GLOSSY.key]
        curved = self.solved(pixels, choice, near=start)
        other = LinearTerms(curved.problem, curved.x)
        found_of_curved = needed_terms(other, choice)
        fall = compared(linear.left(used_of(found)), other.left(used_of(found_of_curved)))
        if fall.sure and linear.held_out:
            gloss = linear.evidence(GLOSSY.key, used_of(found_of_curved))
            gloss = fall._replace(gain=-fall.gain, worth=gloss.worth)
            return curved, {**found_of_curved, GLOSSY.key: gloss}
        return glossy, {**found, CURVED.key: fall._replace(worth=curves.worth)}

    def solved(
        self,
        pixels: Sequence[BallPixels],
        used: Collection[str],
        near: ParameterValues | None = None,
    ) -> _JointSolution:
        """Solve for the terms in use, twice where interreflected light depends on the solution."""
        problem = self._problem(pixels, used, self.board, near)
        start = problem.start if near is None else _nearest(problem, near)
        if REFLECTING.key not in used:
            return _solve(problem, start)
        solution = problem.values(start)
        for _ in range(2):
            lit = self._lit(pixels, solution)
            problem = self._problem(lit, used, self.board, solution)
            solved = _solve(problem, start)
            start, solution = solved.x, solved.values
        return solved

    def by_board(self) -> ParameterValues | None:
        """Return LEDs and terms of the light that the white board alone shows; None without it."""
        if self.board is None:
            return None
        used = (LEDS.key, *(term.key for term in LIGHT_TERMS if term.from_leds or term.loss_per_mm))
        problem = self._problem([], used, self.board, None)
        return problem.values(_fitted(problem, problem.start))

    def _problem(
        self,
        pixels: Sequence[BallPixels],
        used: Collection[str],
        board: BoardLight | None,
        near: ParameterValues | None,
    ) -> JointProblem:
        """Return the problem with the reflectance that the white board shows near a solution."""
        known, flat = self.known, all(press.surface.flat for press in pixels)
        if board is not None and near is not None:
            shown = board.membrane_reflectance(near.leds_mm, near.membrane)
            known = replace(known, reflectance=shown)
        terms = terms_of_sensor(known, used, flat=flat)
        shared = (parameter for term in terms for parameter in term.parameters)
        return JointProblem(
            pixels,
            (*shared, *ball_parameters(self.presses[: len(pixels)], pixels)),
            board,
            self.bright_mm,
        )

    def _lit(self, pixels: Sequence[BallPixels], values: ParameterValues) -> list[BallPixels]:
        """Return the pixels with the interreflected light of a solution."""
        balls, leds_mm = values.poses(pixels), values.leds_mm
        return add_ball_interreflection(
            pixels, balls, values.decay_mm, leds_mm, values.membrane, self.slab
        )

    def contradictions(
        self, solved: _JointSolution, used: Collection[str], asked: Collection[str]
    ) -> tuple[StatedLengthFit, ...]:
        """Return what contradicts the presses, the one that explains most first.

        To first order, balls of another radius, a membrane of another reflectance, other layers and
        LEDs at another height look alike. The curvature of the brightness across a contact, and
        presses at other places, tell them apart. Each is fitted with all other parameters, and
        with LEDs within their tolerances. What held-out presses ask for has the value that needs
        no other LEDs, and comes first unless something else is clearly more likely.
        """
        values, pixels = solved.values, solved.problem.presses
        some = [every_second_pixel(every_second_pixel(p)) for p in pixels]

        def fitted(terms: Collection[str]) -> tuple[JointProblem, Float64Array]:
            problem = self._problem(some, terms, self.board, values)
            return problem, _fitted(problem, _nearest(problem, values))

        free = fitted({*used, LEDS.key})
        found = _stated_lengths(*free, [press.name for press in self.presses])
        likely = min(found, key=lambda one: one.chi_square)
        for i, one in enumerate(found):
            if one.key in asked:
                found[i] = _closer(*fitted(used), one)._replace(asked=True)
            elif one is likely and one.key in STATED:
                found[i] = _closer(*free, one)
        return tuple(sorted(found, key=lambda one: one.unlikely))


def _nearest(problem: JointProblem, near: ParameterValues) -> Float64Array:
    """Return the start of a fit near a solution that may have other terms."""
    balls = near.balls_mm.ravel().tolist()
    shared = [p for p in problem.parameters if p.press is None]
    start = [near.shared.get(p.full_key, p.start) for p in shared]
    # A solution of the white board alone has no balls.
    return np.array([*start, *(balls or problem.start[len(shared) :])])


@dataclass(frozen=True, slots=True)
class _JointSolution:
    """Solution of a fit: parameters with standard deviations, and misfits."""

    x: Float64Array
    sd: Float64Array
    misfit: float
    ball_misfits: Float64Array
    problem: JointProblem

    @property
    def values(self) -> ParameterValues:
        """The parameters by their meaning."""
        return self.problem.values(self.x)


def _solve(problem: JointProblem, start: Float64Array) -> _JointSolution:
    """Solve for all free parameters."""
    return _described(problem, _fitted(problem, start))


def _fitted(problem: JointProblem, start: Float64Array) -> Float64Array:
    """Return the values (P,) that fit best."""
    free, (low, high) = problem.free, problem.limits

    def whole(part: Float64Array) -> Float64Array:
        x = problem.start.copy()
        x[free] = part
        return x

    fit = fit_least_squares(
        lambda part: problem.all(whole(part)),
        lambda part: problem.jacobian(whole(part))[:, free],
        start[free],
        (low[free], high[free]),
        scale=problem.typical_change[free],
        robust=problem.robust,
    )
    return whole(fit.x)


def _stated_lengths(
    problem: JointProblem, x: Float64Array, names: Sequence[str]
) -> list[StatedLengthFit]:
    """Return each stated length that fits best, and the balls that are odd.

    A ball is odd if its own press asks for another radius, far more than the others do.
    """
    step = _by_one_step(problem, x, np.hstack([problem.by_stated(x), problem.by_radius(x)]))
    of_ball = np.arange(step.gain.size) >= len(problem.stated)
    # Errors that the model has in every press are common; only one that stands out is odd.
    usual = max(float(np.median(step.gain[of_ball])) / MEDIAN_OF_SQUARE, 1.0)
    sd = step.sd * np.where(of_ball, usual**0.5, 1.0)
    found = ~of_ball | (step.gain > ODD_SDS**2 * usual)
    keys = [*problem.stated, *(f"ball {name}" for name in names)]
    return [
        StatedLengthFit(keys[i], 1.0 + float(step.change[i]), float(sd[i]), float(step.left[i]))
        for i in np.flatnonzero(found).tolist()
    ]


def _closer(problem: JointProblem, x: Float64Array, near: StatedLengthFit) -> StatedLengthFit:
    """Return a fit with the value that one more step gives, from all else that fits with it."""
    changed = problem.with_stated(near.key, near.value)
    x = _fitted(changed, x + changed.start - problem.start)
    step = _by_one_step(changed, x, problem.by_length(x, near.key, near.value)[:, None])
    value = near.value + float(step.change[0])
    return StatedLengthFit(near.key, value, float(step.sd[0]), near.chi_square)


class _OneStep(NamedTuple):
    """Changes of K values that fit best: each (K,), with all other parameters."""

    change: Float64Array
    sd: Float64Array
    gain: Float64Array
    left: Float64Array


def _by_one_step(problem: JointProblem, x: Float64Array, by_value: Float64Array) -> _OneStep:
    """Change each of K values once, by the derivative of all residuals (M, K), at a solution.

    Of the steps, `gain` is the fall of chi square, in which large residuals count less, and `left`
    is what remains of it.
    """
    residual = problem.all(x)
    weight = np.where(problem.robust, (1.0 + residual**2) ** -0.25, 1.0)[:, None]
    slopes = weight * problem.jacobian(x)[:, problem.free]
    by_value, left = weight * by_value, weight[:, 0] * residual
    inverse = np.linalg.pinv(slopes.T @ slopes, hermitian=True)
    along = slopes.T @ by_value
    curvature = (by_value**2).sum(axis=0) - (along * (inverse @ along)).sum(axis=0)
    curvature = np.maximum(curvature, np.finfo(float).tiny)
    gradient = by_value.T @ left - along.T @ (inverse @ (slopes.T @ left))
    gain = gradient**2 / curvature
    return _OneStep(-gradient / curvature, curvature**-0.5, gain, left @ left - gain)


def _described(problem: JointProblem, x: Float64Array) -> _JointSolution:
    """Return a solution with its standard deviations and misfits."""
    residuals = problem.residuals(x)
    weights = [p.weight.ravel() for p in problem.presses]
    scaled = np.concatenate(residuals)
    misfit = _relative_misfit(scaled, np.concatenate(weights))
    of_balls = [_relative_misfit(r, w) for r, w in zip(residuals, weights, strict=True)]
    curvature = problem.jacobian(x)[:, problem.free]
    variance = np.diag(np.linalg.pinv(curvature.T @ curvature))
    sd = np.zeros(x.size)
    sd[problem.free] = np.sqrt(np.maximum(variance, 0.0))
    return _JointSolution(x, sd, misfit, np.array(of_balls), problem)


def _relative_misfit(scaled: Float64Array, weight: Float64Array) -> float:
    """Return the robust misfit of the ratio, or NaN if no pixel is usable."""
    valid_mask = (weight > 0.0) & (scaled != 0.0)
    if not valid_mask.any():
        return float("nan")
    return robust_sd(CORRELATION * scaled[valid_mask] / weight[valid_mask])
