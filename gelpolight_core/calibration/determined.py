"""How well the ball presses determine the parameters that they share in the joint refinement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.arrays import Array
from gelpolight_core.calibration.refinement_parameters import Parameter
from gelpolight_core.calibration.untouched import WARN_PERCENT
from gelpolight_core.finding import Finding, judge

MOST = 0.5
"""A parameter belongs to a direction if most of its variance is along it."""


@dataclass(frozen=True, slots=True)
class Determined:
    """Singular values and directions of the scaled Jacobian, without what the balls explain.

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
    scale: Array
    singular: Array
    directions: Array

    @staticmethod
    def of(curvature: Array, parameters: NDArray[np.int64]) -> Determined:
        """Return what normal equations (N, N) determine; the shared parameters come first."""
        shared, balls = slice(None, parameters.size), slice(parameters.size, None)
        left = curvature[balls, shared]
        own = curvature[shared, shared] - left.T @ np.linalg.pinv(curvature[balls, balls]) @ left
        rounding = np.finfo(float).eps * np.maximum(np.diag(curvature)[shared], 1.0)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(own), rounding))
        squares, directions = np.linalg.eigh(own * np.outer(scale, scale))
        squares = np.maximum(squares, np.finfo(float).eps * squares[-1])
        return Determined(parameters, scale, np.sqrt(squares), directions)

    @property
    def condition(self) -> float:
        """Largest over smallest singular value: 1 if no parameter acts like another."""
        return float(self.singular[-1] / self.singular[0])

    @property
    def weakest(self) -> list[int]:
        """The shared parameters of the worst determined direction, as of `_acting`."""
        return self._acting(self.directions / self.singular, 0)

    def _acting(self, steps: Array, direction: int) -> list[int]:
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
        """The largest correlation of two shared parameters, and which they are."""
        roots = self.directions / self.singular
        roots /= np.linalg.norm(roots, axis=1, keepdims=True)
        found = roots @ roots.T
        first, second = np.unravel_index(np.argmax(np.abs(np.triu(found, 1))), found.shape)
        pair = self.parameters[[first, second]].tolist()
        return float(found[first, second]), pair[0], pair[1]

    def costly(self, covariance: Array, gradient: Array) -> tuple[float, list[int]]:
        """Return the largest effect of an independent direction, and its parameters.

        The directions are those of the covariance of the scaled parameters; squares of their
        effects add up to the variance.

        Parameters
        ----------
        covariance : (shared, shared)
            Of the shared parameters.
        gradient : (shared,)
            What a unit of each parameter changes.
        """
        free = self.parameters
        scaled = covariance[np.ix_(free, free)] / np.outer(self.scale, self.scale)
        sizes, directions = np.linalg.eigh(scaled)
        steps = directions * np.sqrt(np.maximum(sizes, 0.0))
        effects = np.abs((gradient[free] * self.scale) @ steps)
        worst = int(np.argmax(effects))
        return float(effects[worst]), self._acting(steps, worst)


def judge_determined(
    determined: Determined, shared: Sequence[Parameter], covariance: Array, gradient: Array
) -> tuple[Finding, ...]:
    """Judge how well the shared parameters are determined.

    Parameters
    ----------
    determined : Determined
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
