"""Which terms a sensor needs: those without which held-out presses clearly fit worse.

The problem with all terms is made linear at its solution. Then each set of terms, with the others
exactly neutral, is a small linear problem, and so is leaving out one press at a time. No choice of
LEDs, balls or terms needs a fit of its own.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.light.parameter import Parameter
from gelpolight_core.stages.balls.press_agreement import LEAST_PRESSES

from .refinement_kernel import CORRELATION
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
    worth : float
        Change of the calculated light of the presses (rms, share of the light of the untouched
        membrane) between the fits with and without it, in which all else is fitted again.
    """

    used: bool
    gain: float
    scatter: float
    worth: float = 0.0

    @property
    def sure(self) -> bool:
        """Whether held-out presses clearly miss the term."""
        return self.gain > SURE * max(self.scatter, SURE)


class _PressEquations(NamedTuple):
    """Normal equations of each press without its ball: (N, n, n), (N, n), and (N,) at x.

    `light` (N, n, n) gives the mean square change of its light by that of the parameters.
    """

    curvature: Float64Array
    gradient: Float64Array
    square: Float64Array
    light: Float64Array


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
        weights = [press.weight.ravel() for press in problem.presses]
        equations = [
            _without_ball(part[:, free], part[:, ball], residual, known)
            for part, ball, residual, known in zip(parts[:-1], own, residuals, weights, strict=True)
        ]
        self.presses = _PressEquations(*(np.array(part) for part in zip(*equations, strict=True)))
        prior, left = parts[-1][:, free], problem.priors(x)
        summed = self.presses.curvature.sum(axis=0), self.presses.gradient.sum(axis=0)
        self._total = summed[0] + prior.T @ prior, summed[1] + prior.T @ left

    @property
    def held_out(self) -> bool:
        """Whether there are presses enough to leave one out."""
        return len(self.presses.square) >= LEAST_PRESSES

    def evidence(self, key: str, used: Collection[str]) -> TermEvidence:
        """Return what held-out presses say of a term, beside those in use."""
        sets = {*used} - {key}, {*used, key}
        change = np.subtract(*map(self._step, sets))
        worth = float(np.sqrt(change @ self.presses.light.mean(axis=0) @ change))
        found = compared(*map(self.left, sets))._replace(used=key in used, worth=worth)
        return found if self.held_out else found._replace(scatter=SURE)

    def left(self, used: Collection[str]) -> Float64Array:
        """Return the squared residuals of each press with some optional terms, (N,).

        Each press is judged by a fit to the others, if there are presses enough.

        Parameters
        ----------
        used : collection of str
            Keys of these terms and lengths; the others are neutral, or as they are stated.
        """
        left = self.presses.square.copy()
        for k, (curvature, gradient, _, _) in enumerate(zip(*self.presses, strict=True)):
            step = self._step(used, *[(curvature, gradient)] * self.held_out)
            left[k] += 2.0 * gradient @ step + step @ curvature @ step
        return left

    def _step(self, used: Collection[str], less: Sequence[Any] = (0.0, 0.0)) -> Float64Array:
        """Return the change (n,) to the fit with some optional terms, without some equations."""
        choices = {*OPTIONAL, *self.stated}
        free = np.array([term in used or term not in choices for term in self._terms])
        a, b = (whole - part for whole, part in zip(self._total, less, strict=True))
        step = np.where(free, 0.0, self._to_neutral)
        step[free] = -np.linalg.lstsq(a[np.ix_(free, free)], b[free] + a[free] @ step, rcond=None)[
            0
        ]
        return step


def used_of(evidence: Mapping[str, TermEvidence]) -> set[str]:
    """Return the keys of what is in use."""
    return {key for key, one in evidence.items() if one.used}


def term_of(parameter: Parameter) -> str:
    """Return the key of the term of a parameter that all presses share."""
    return _TERM_BY_KEY.get(parameter.key, LEDS.key)


_TERM_BY_KEY = {p.key: term.key for term in TERMS for p in term.parameters}


def _neutral(parameter: Parameter) -> float:
    """Return the value without the term; an LED stays where the mirror shows it."""
    return parameter.start if term_of(parameter) == LEDS.key else parameter.neutral


def _without_ball(
    shared: Float64Array, ball: Float64Array, residual: Float64Array, known: Float64Array
) -> tuple[Float64Array, Float64Array, float, Float64Array]:
    """Return the normal equations of a press, of which the ball follows the shared parameters.

    With soft L1, larger residuals have less weight, beside what is known of the pixels.
    """
    weight, usable = (1.0 + residual**2) ** -0.25, residual != 0.0
    shared, ball, residual = weight[:, None] * shared, weight[:, None] * ball, weight * residual
    basis, _ = np.linalg.qr(ball)
    shared, residual = shared - basis @ (basis.T @ shared), residual - basis @ (basis.T @ residual)
    light = CORRELATION * shared[usable] / (weight * known)[usable, None]
    mean_square = light.T @ light / max(len(light), 1)
    return shared.T @ shared, shared.T @ residual, float(residual @ residual), mean_square


def needed_terms(linear: LinearTerms, candidates: Sequence[str]) -> dict[str, TermEvidence]:
    """Return what held-out presses say of optional terms, and of each stated length.

    The search starts with all and with none of them; what fits held-out presses better is chosen. A
    length that is stated wrongly is one of them, so that no term takes up its error.

    Parameters
    ----------
    linear : LinearTerms
        At a solution with all these terms.
    candidates : sequence of str
        Keys of the optional terms.
    """
    candidates = (*candidates, *linear.stated)
    sets = [_settled(linear, candidates, start) for start in (candidates, ())]
    used = min(sets, key=lambda keys: float(linear.left(keys).sum()))
    return {key: linear.evidence(key, used) for key in candidates}


def _settled(linear: LinearTerms, candidates: Sequence[str], start: Collection[str]) -> set[str]:
    """Return a set of terms that held-out presses clearly miss, without others that they miss."""
    used = _pruned(linear, start)
    while missed := {
        k: e for k in candidates if k not in used and (e := linear.evidence(k, used)).sure
    }:
        used.add(max(missed, key=lambda key: missed[key].gain))
    return _pruned(linear, used)


def _pruned(linear: LinearTerms, start: Collection[str]) -> set[str]:
    """Leave out the term that held-out presses miss least, until they clearly miss each."""
    used = set(start)
    while unsure := {k: e for k in used if not (e := linear.evidence(k, used)).sure}:
        used.remove(min(unsure, key=lambda key: unsure[key].gain))
    return used


def compared(before: Float64Array, after: Float64Array) -> TermEvidence:
    """Return how far the squared residuals (N,) of presses fall, as evidence of a term not used."""
    fall = before - after
    scatter = float(np.sqrt(fall.size) * fall.std(ddof=1)) if fall.size > 1 else SURE
    return TermEvidence(False, float(fall.sum()), scatter)
