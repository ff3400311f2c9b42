"""How far the joint refinement's result is known, judged by how far the presses disagree.

Pixels of one ball err together, by how much nobody knows: lens, ball radius, what the membrane's
closed form leaves out. Leaving out one ball at a time (the jackknife, one Gauss-Newton step each)
counts all that differs from ball to ball at its true weight. Errors that all balls share, such as
a wrong radius of all of them, no picture shows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def jackknife_covariance(
    jacobians: Sequence[Array], residuals: Sequence[Array], prior_jacobian: Array, *, common: int
) -> Array:
    """Return the covariance of the parameters that all presses share.

    A lone press leaves nothing out to compare it with. What is returned then is a lower bound: the
    covariance of least squares, as if the pixels erred each by itself, and as much larger as the
    residuals exceed their weights.

    Parameters
    ----------
    jacobians : sequence of (N_i, P)
        Of each press's weighted residuals.
    residuals : sequence of (N_i,)
        At the solution, weighted alike.
    prior_jacobian : (M, P)
        Of the priors, which are never left out; their own standard deviations count in full.
    common : int
        How many of the parameters, the first, are shared.

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
    # Pixels of weight 0 have empty rows, parameters that are held or not seen empty columns.
    rows = np.concatenate(jacobians) != 0.0
    freedom = int(rows.any(axis=1).sum()) - int(rows.any(axis=0).sum())
    return float(np.sum(np.concatenate(residuals) ** 2)) / max(freedom, 1)
