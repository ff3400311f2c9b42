"""Which terms a sensor needs: those without which held-out presses clearly fit worse.

The problem with all terms is made linear at its solution. Then each set of terms, with the others
exactly neutral, is a small linear problem, and so is leaving out one press at a time. No choice of
LEDs, balls or terms needs a fit of its own.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.light.parameter import Parameter
from gelpolight_core.stages.balls.press_agreement import LEAST_PRESSES

from .refinement_parameters import LEDS, OPTIONAL, TERMS
from .refinement_problem import JointProblem

SURE = 2.5
"""A term is needed if held-out presses say so by more standard deviations than this: those of the
scatter between presses, and those of noise, by which chi square falls by the square of it."""


class TermEvidence(NamedTuple):
    """What held-out presses say of a term.

    Attributes
    ----------
    used : bool
        Whether the sensor needs it.
    gain : float
        Rise of the squared residuals of held-out presses, over that of all terms in use, if it is
        left out, or fall if it is added.
    scatter : float
        Standard deviation of this gain, from its scatter between presses.
    """

    used: bool
    gain: float
    scatter: float


class _PressEquations(NamedTuple):
    """Normal equations of each press without its ball: (N, n, n), (N, n), and (N,) at x."""

    curvature: Float64Array
    gradient: Float64Array
    square: Float64Array


class LinearTerms:
    """The joint problem at a solution with all terms, as equations of the shared parameters.

    Parameters
    ----------
    problem : JointProblem
        With all terms.
    x : (P,)
        Its solution.

    Attributes
    ----------
    stated : tuple of str
        Keys of the stated lengths that may be wrong, which are candidates as terms are.
    """

    def __init__(self, problem: JointProblem, x: Float64Array) -> None:
        free = np.flatnonzero(problem.free & problem.shared)
        balls = np.flatnonzero(problem.free & ~problem.shared)
        shared, self.stated = [problem.parameters[i] for i in free], problem.stated
        jacobian = np.hstack([problem.jacobian(x), problem.by_stated(x)])
        residuals = problem.residuals(x)
        self._terms = [*map(term_of, shared), *self.stated]
        neutral = [*map(_neutral, shared), *np.ones(len(self.stated))]
        self._to_neutral = neutral - np.append(x[free], np.ones(len(self.stated)))
        free = np.append(free, np.arange(x.size, jacobian.shape[1]))
        ends = np.cumsum([r.size for r in residuals])
        parts = np.split(jacobian, ends)
        own = [balls[[problem.parameters[i].press == k for i in balls]] for k in range(len(ends))]
        equations = [
            _without_ball(part[:, free], part[:, ball], residual)
            for part, ball, residual in zip(parts[:-1], own, residuals, strict=True)
        ]
        self.presses = _PressEquations(*(np.array(part) for part in zip(*equations, strict=True)))
        prior, left = parts[-1][:, free], problem.priors(x)
        self._prior = prior.T @ prior, prior.T @ left

    def left(self, used: Collection[str], held_out: bool) -> Float64Array:
        """Return the squared residuals of each press with some optional terms, (N,).

        Parameters
        ----------
        used : collection of str
            Keys of these terms and lengths; the others are neutral, or as they are stated.
        held_out : bool
            Whether each press is judged by a fit to the others.
        """
        choices = {*OPTIONAL, *self.stated}
        free = np.array([term in used or term not in choices for term in self._terms])
        fixed = np.where(free, 0.0, self._to_neutral)
        curvature, gradient, square = self.presses
        left = np.empty(len(square))
        total, slope = curvature.sum(axis=0) + self._prior[0], gradient.sum(axis=0) + self._prior[1]
        for k in range(len(square)):
            a, b = (total - curvature[k], slope - gradient[k]) if held_out else (total, slope)
            step = fixed.copy()
            step[free] = -np.linalg.lstsq(
                a[np.ix_(free, free)], b[free] + a[free] @ fixed, rcond=None
            )[0]
            left[k] = square[k] + 2.0 * gradient[k] @ step + step @ curvature[k] @ step
        return left


def term_of(parameter: Parameter) -> str:
    """Return the key of the term of a parameter that all presses share."""
    return _TERM_BY_KEY.get(parameter.key, LEDS.key)


_TERM_BY_KEY = {p.key: term.key for term in TERMS for p in term.parameters}


def _neutral(parameter: Parameter) -> float:
    """Return the value without the term; an LED stays where the mirror shows it."""
    return parameter.start if term_of(parameter) == LEDS.key else parameter.neutral


def _without_ball(
    shared: Float64Array, ball: Float64Array, residual: Float64Array
) -> tuple[Float64Array, Float64Array, float]:
    """Return the normal equations of a press, of which the ball follows the shared parameters.

    With soft L1, larger residuals have less weight.
    """
    weight = (1.0 + residual**2) ** -0.25
    shared, ball, residual = weight[:, None] * shared, weight[:, None] * ball, weight * residual
    basis, _ = np.linalg.qr(ball)
    shared, residual = shared - basis @ (basis.T @ shared), residual - basis @ (basis.T @ residual)
    return shared.T @ shared, shared.T @ residual, float(residual @ residual)


def needed_terms(
    problem: JointProblem, x: Float64Array, candidates: Sequence[str]
) -> Mapping[str, TermEvidence]:
    """Return what held-out presses say of each optional term, and of each stated length.

    Of all terms, the one that held-out presses miss least is left out, again and again, until they
    clearly miss any other. Then those that they clearly miss come back. A length that is stated
    wrongly is one of them, so that no term takes up its error.

    Parameters
    ----------
    problem, x
        The problem with all terms, and its solution.
    candidates : sequence of str
        Keys of the optional terms of the problem.
    """
    linear = LinearTerms(problem, x)
    held_out = len(linear.presses.square) >= LEAST_PRESSES
    candidates = (*candidates, *linear.stated)

    def evidence(key: str, used: Collection[str]) -> TermEvidence:
        without, with_it = (linear.left(keys, held_out) for keys in ({*used} - {key}, {*used, key}))
        found = compared(without, with_it)._replace(used=key in used)
        return found if held_out else found._replace(scatter=SURE)

    def is_missed(one: TermEvidence) -> bool:
        return one.gain > SURE * max(one.scatter, SURE)

    used = set(candidates)
    while unsure := {k: e for k in used if not is_missed(e := evidence(k, used))}:
        used.remove(min(unsure, key=lambda key: unsure[key].gain))
    # Of two terms that look alike, the wrong one may have been left out first.
    while missed := {
        k: e for k in candidates if k not in used and is_missed(e := evidence(k, used))
    }:
        used.add(max(missed, key=lambda key: missed[key].gain))
    return {key: evidence(key, used) for key in candidates}


def held_out_residuals(
    problem: JointProblem, x: Float64Array, used: Collection[str]
) -> Float64Array:
    """Return the squared residuals of each press with some optional terms, by fits to the others.

    Parameters
    ----------
    problem, x, used
        As for :func:`needed_terms`, and the keys of these terms.
    """
    linear = LinearTerms(problem, x)
    return linear.left(used, held_out=len(linear.presses.square) >= LEAST_PRESSES)


def compared(before: Float64Array, after: Float64Array) -> TermEvidence:
    """Return how far the squared residuals (N,) of presses fall, as evidence of a term not used."""
    fall = before - after
    scatter = float(np.sqrt(fall.size) * fall.std(ddof=1)) if fall.size > 1 else SURE
    return TermEvidence(False, float(fall.sum()), scatter)
