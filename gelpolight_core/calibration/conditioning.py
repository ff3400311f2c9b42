"""How well the ball presses determine the parameters that they share in the joint refinement.

Errors of the pixels of one ball are correlated by an unknown amount: lens, ball radius, and effects
that the membrane model leaves out. Leaving out one ball at a time (the jackknife, one Gauss-Newton
step each) gives all differences between balls their true weight. No image shows errors that all
balls share, such as a wrong radius of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.finding import Finding, judge
from gelpolight_core.light.parameter import Parameter

from .height_limits import WARN_PERCENT
from .refinement_problem import JointProblem

MOST = 0.5
"""A parameter belongs to a direction if most of its variance is along it."""


@dataclass(frozen=True, slots=True)
class ParameterConditioning:
    """Singular values of the scaled Jacobian, without the part that the balls explain.

    Each column of the weighted Jacobian, projected off the columns of the balls, is divided by its
    length, so that neither units nor typical changes matter.

    Attributes
    ----------
    parameters : (n,) int
        The free ones, as indices of the shared parameters.
    scale : (n,)
        Change of each that alone changes the residuals by 1 (norm).
    singular : (n,)
        Singular values, the smallest first.
    directions : (n, n)
        Right singular vectors, one a column.

    References
    ----------
    D. A. Belsley, E. Kuh, R. E. Welsch, "Regression Diagnostics", 1980, chapter 3: scaled condition
    number and shares of the variance.
    """

    parameters: NDArray[np.int64]
    scale: Float64Array
    singular: Float64Array
    directions: Float64Array

    @staticmethod
    def from_jacobian(
        curvature: Float64Array, parameters: NDArray[np.int64]
    ) -> ParameterConditioning:
        """Return the conditioning of normal equations (N, N) with the shared parameters first."""
        shared, balls = slice(None, parameters.size), slice(parameters.size, None)
        cross, inverse = curvature[balls, shared], np.linalg.pinv(curvature[balls, balls])
        reduced = curvature[shared, shared] - cross.T @ inverse @ cross
        rounding = np.finfo(float).eps * np.maximum(np.diag(curvature)[shared], 1.0)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(reduced), rounding))
        squares, directions = np.linalg.eigh(reduced * np.outer(scale, scale))
        squares = np.maximum(squares, np.finfo(float).eps * squares[-1])
        return ParameterConditioning(parameters, scale, np.sqrt(squares), directions)

    @property
    def condition(self) -> float:
        """Largest over smallest singular value: 1 if no parameter acts like another."""
        return float(self.singular[-1] / self.singular[0])

    @property
    def weakest(self) -> list[int]:
        """The shared parameters of the worst determined direction, as of `_acting`."""
        return self._acting(self.directions / self.singular, 0)

    def _acting(self, steps: Float64Array, direction: int) -> list[int]:
        """Return the shared parameters with `MOST` of their variance along a direction.

        If there is none, the one with the largest share; the largest share comes first. One
        standard deviation along each direction is a column of `steps`.
        """
        variance = steps**2
        share = variance[:, direction] / np.maximum(variance.sum(axis=1), np.finfo(float).tiny)
        order = np.argsort(-share)
        named = order[share[order] >= min(MOST, share.max())]
        return [int(self.parameters[k]) for k in named]

    @property
    def correlation(self) -> tuple[float, int, int]:
        """The largest correlation of two shared parameters with their indices."""
        roots = self.directions / self.singular
        roots /= np.linalg.norm(roots, axis=1, keepdims=True)
        matrix = roots @ roots.T
        first, second = np.unravel_index(np.argmax(np.abs(np.triu(matrix, 1))), matrix.shape)
        pair = self.parameters[[first, second]].tolist()
        return float(matrix[first, second]), pair[0], pair[1]

    def costly(self, covariance: Float64Array, gradient: Float64Array) -> tuple[float, list[int]]:
        """Return the largest effect of an independent direction with its parameters.

        The directions are those of the covariance of the scaled parameters; squares of their
        effects add up to the variance.

        Parameters
        ----------
        covariance : (shared, shared)
            Covariance of the shared parameters.
        gradient : (shared,)
            Change by a unit of each parameter.
        """
        free = self.parameters
        scaled = covariance[np.ix_(free, free)] / np.outer(self.scale, self.scale)
        sizes, directions = np.linalg.eigh(scaled)
        steps = directions * np.sqrt(np.maximum(sizes, 0.0))
        effects = np.abs((gradient[free] * self.scale) @ steps)
        worst = int(np.argmax(effects))
        return float(effects[worst]), self._acting(steps, worst)


def shared_covariance(
    problem: JointProblem, x: Float64Array
) -> tuple[tuple[Parameter, ...], Float64Array, ParameterConditioning]:
    """Return the S parameters that all presses share, with covariance (S, S) and conditioning.

    The covariance is 0 for fixed ones.
    """
    jacobian = problem.jacobian(x)
    parts = problem.residuals(x)
    # With soft L1, larger residuals have less weight.
    weights = [(1.0 + r**2) ** -0.25 for r in parts]
    shared = np.flatnonzero(problem.shared)
    solved = shared[problem.free[shared]]
    order = np.concatenate([solved, np.flatnonzero(~problem.shared)])
    rows = np.split(jacobian[:, order], np.cumsum([r.size for r in parts]))
    weighted = [w[:, None] * j for w, j in zip(weights, rows[:-1], strict=True)]
    free_covariance = jackknife_covariance(
        weighted,
        [w * r for w, r in zip(weights, parts, strict=True)],
        rows[-1],
        common=solved.size,
    )
    covariance = np.zeros((shared.size, shared.size))
    index = np.flatnonzero(problem.free[shared])
    covariance[np.ix_(index, index)] = free_covariance
    curvature = np.sum([j.T @ j for j in (*weighted, rows[-1])], axis=0)
    parameters = tuple(problem.parameters[i] for i in shared)
    return parameters, covariance, ParameterConditioning.from_jacobian(curvature, index)


def jackknife_covariance(
    jacobians: Sequence[Float64Array],
    residuals: Sequence[Float64Array],
    prior_jacobian: Float64Array,
    *,
    common: int,
) -> Float64Array:
    """Return the covariance of the parameters shared by all presses.

    A single press cannot be left out. The result is then a lower bound: the covariance of least
    squares, as if the pixel errors were independent, scaled up by how far the residuals exceed
    their weights.

    Parameters
    ----------
    jacobians : sequence of (N_i, P)
        Jacobian of each press's weighted residuals.
    residuals : sequence of (N_i,)
        At the solution, with the same weights.
    prior_jacobian : (M, P)
        Jacobian of the priors, which are never left out; their own standard deviations count in
        full.
    common : int
        Number of shared parameters, which come first.

    Returns
    -------
    (common, common)

    References
    ----------
    Efron, "The Jackknife, the Bootstrap and Other Resampling Plans", 1982, chapter 3.
    """
    prior = prior_jacobian.T @ prior_jacobian
    normal = [j.T @ j for j in jacobians]
    total = np.sum(normal, axis=0) + prior
    count = len(jacobians)
    inverse = np.linalg.pinv(total, hermitian=True)
    by_priors = (inverse @ prior @ inverse)[:common, :common]
    if count < 2:
        excess = max(_reduced_chi_square(jacobians, residuals), 1.0)
        return np.asarray(excess * (inverse @ normal[0] @ inverse)[:common, :common] + by_priors)
    moves = np.array(
        [
            np.linalg.pinv(total - press_normal, hermitian=True)[:common] @ (j.T @ r)
            for j, r, press_normal in zip(jacobians, residuals, normal, strict=True)
        ]
    )
    moves -= moves.mean(axis=0)
    return np.asarray((count - 1) / count * moves.T @ moves + by_priors)


def _reduced_chi_square(
    jacobians: Sequence[Float64Array], residuals: Sequence[Float64Array]
) -> float:
    # Pixels of weight 0 have empty rows; fixed or unobserved parameters have empty columns.
    rows = np.concatenate(jacobians) != 0.0
    freedom = int(rows.any(axis=1).sum()) - int(rows.any(axis=0).sum())
    return float(np.sum(np.concatenate(residuals) ** 2)) / max(freedom, 1)


def judge_determined(
    determined: ParameterConditioning,
    shared: Sequence[Parameter],
    covariance: Float64Array,
    gradient: Float64Array,
) -> tuple[Finding, ...]:
    """Judge how well the shared parameters are determined.

    Parameters
    ----------
    determined : ParameterConditioning
        Conditioning of the solution.
    shared : sequence of Parameter
        The S parameters that all presses share.
    covariance : (S, S)
        Their covariance.
    gradient : (S,)
        Relative change of a typical height by each of them.
    """

    def names(parameters: Sequence[int]) -> str:
        return ", ".join(shared[index].name for index in parameters)

    size, first, second = determined.correlation
    effect, costly = determined.costly(covariance, gradient)
    return (
        judge(
            "joint_condition",
            f"Condition number of the refinement (least certain: {names(determined.weakest)})",
            determined.condition,
        ),
        judge(
            "joint_correlation",
            (
                f"Largest correlation of two parameters ({shared[first].name} "
                f"with {shared[second].name})"
            ),
            size,
        ),
        judge(
            "joint_direction_percent",
            f"Height uncertainty from one direction ({names(costly)})",
            100.0 * effect,
            "%",
            warn=WARN_PERCENT,
            remedy="Press balls of other sizes, deeper, and at more positions",
        ),
    )
