"""Uncertainty of the joint refinement, from the disagreement between presses.

Errors of the pixels of one ball are correlated by an unknown amount: lens, ball radius, and effects
that the membrane model leaves out. Leaving out one ball at a time (the jackknife, one Gauss-Newton
step each) gives all differences between balls their true weight. No image shows errors that all
balls share, such as a wrong radius of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gelpolight_core.arrays import Array


def jackknife_covariance(
    jacobians: Sequence[Array], residuals: Sequence[Array], prior_jacobian: Array, *, common: int
) -> Array:
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
            np.linalg.pinv(total - own, hermitian=True)[:common] @ (j.T @ r)
            for j, r, own in zip(jacobians, residuals, normal, strict=True)
        ]
    )
    moves -= moves.mean(axis=0)
    return np.asarray((count - 1) / count * moves.T @ moves + by_priors)


def _reduced_chi_square(jacobians: Sequence[Array], residuals: Sequence[Array]) -> float:
    # Pixels of weight 0 have empty rows; fixed or unobserved parameters have empty columns.
    rows = np.concatenate(jacobians) != 0.0
    freedom = int(rows.any(axis=1).sum()) - int(rows.any(axis=0).sum())
    return float(np.sum(np.concatenate(residuals) ** 2)) / max(freedom, 1)
