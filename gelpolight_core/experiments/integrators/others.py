"""Integrators of others, from their published equations, in double precision.

Each takes d(depth)/dx and d(depth)/dy (rows, columns) and the pitch in mm, and returns the depth in
mm. The constant is free: these methods do not determine where the depth is 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import spsolve

Array = NDArray[np.floating[Any]]


def cosine_transform(slope_x: Array, slope_y: Array, pitch_mm: float) -> Array:
    """Solve the Poisson equation with Neumann boundary by a DCT (Simchony et al. 1990)."""
    divergence = _divergence(slope_x, slope_y) * pitch_mm
    return _by_cosines(divergence, *(_waves(n, 0) for n in divergence.shape))


def shifted_cosine_transform(slope_x: Array, slope_y: Array, pitch_mm: float) -> Array:
    """Do the same with the faults that are common in open tactile libraries.

    Wave k is divided by the eigenvalue of wave k + 1, and differences over two nodes are not
    halved: depths are too low or too high, depending on the width of the contact.
    """
    padded_x, padded_y = (np.pad(s, 1, mode="edge") for s in (slope_x, slope_y))
    divergence = padded_x[1:-1, 2:] - padded_x[1:-1, :-2] + padded_y[2:, 1:-1] - padded_y[:-2, 1:-1]
    return _by_cosines(divergence * pitch_mm, *(_waves(n, 1) for n in divergence.shape))


def frankot_chellappa(slope_x: Array, slope_y: Array, pitch_mm: float) -> Array:
    """Project the slopes on integrable ones by a Fourier transform (1988); periodic boundary."""
    rows, columns = slope_x.shape
    wave_y = 2.0 * np.pi * np.fft.fftfreq(rows, pitch_mm)[:, None]
    wave_x = 2.0 * np.pi * np.fft.rfftfreq(columns, pitch_mm)[None, :]
    square = wave_x**2 + wave_y**2
    square[0, 0] = 1.0
    spectrum = -1j * (wave_x * scipy.fft.rfft2(slope_x) + wave_y * scipy.fft.rfft2(slope_y))
    spectrum /= square
    spectrum[0, 0] = 0.0
    return np.asarray(scipy.fft.irfft2(spectrum, s=(rows, columns)))


def sparse_quadratic(
    slope_x: Array, slope_y: Array, pitch_mm: float, weight: Array | None = None
) -> Array:
    """Solve the weighted least squares over all edges directly (Horn and Brooks 1986).

    Parameters
    ----------
    slope_x, slope_y : (rows, columns)
        Slopes.
    pitch_mm : float
        Distance between nodes.
    weight : (rows, columns), optional
        An edge has the smaller weight of its two nodes.
    """
    shape = slope_x.shape
    trust = np.ones(shape) if weight is None else np.asarray(weight, np.float64)
    nodes = np.arange(slope_x.size).reshape(shape)
    edges, targets, weights = [], [], []
    for slope, axis in ((slope_x, 1), (slope_y, 0)):
        before, after = _sides(axis)
        edges.append(np.stack([nodes[before].ravel(), nodes[after].ravel()]))
        targets.append(0.5 * pitch_mm * (slope[before] + slope[after]).ravel())
        weights.append(np.minimum(trust[before], trust[after]).ravel())
    ends = np.concatenate(edges, axis=1)
    target, own = np.concatenate(targets), np.concatenate(weights)
    ones = np.ones(target.size)
    rows = np.tile(np.arange(target.size), 2)
    difference = csc_matrix(
        (np.concatenate([ones, -ones]), (rows, np.concatenate([ends[1], ends[0]]))),
        shape=(target.size, slope_x.size),
    )
    weighted = difference.T @ diags_array(own)
    # A very small weight fixes the constant, and nodes without any edge.
    matrix = (weighted @ difference + 1e-9 * diags_array(np.ones(slope_x.size))).tocsc()
    return np.asarray(spsolve(matrix, weighted @ target)).reshape(shape)


def _sides(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the nodes before and after each edge along an axis."""
    all_, first, last = slice(None), slice(None, -1), slice(1, None)
    return ((all_, first), (all_, last)) if axis == 1 else ((first, all_), (last, all_))


def _divergence(slope_x: Array, slope_y: Array) -> Array:
    """Return the sum of the edges' mean slopes that leave each node; none across the border."""
    along_x = np.zeros((slope_x.shape[0], slope_x.shape[1] + 1))
    along_x[:, 1:-1] = 0.5 * (slope_x[:, 1:] + slope_x[:, :-1])
    along_y = np.zeros((slope_x.shape[0] + 1, slope_x.shape[1]))
    along_y[1:-1] = 0.5 * (slope_y[1:] + slope_y[:-1])
    return np.asarray(np.diff(along_x, axis=1) + np.diff(along_y, axis=0))


def _waves(length: int, shift: int) -> Array:
    return np.asarray(4.0 * np.sin(0.5 * np.pi * (np.arange(length) + shift) / length) ** 2)


def _by_cosines(divergence: Array, waves_y: Array, waves_x: Array) -> Array:
    eigenvalues = waves_y[:, None] + waves_x
    eigenvalues[0, 0] = eigenvalues[0, 0] or 1.0
    spectrum = scipy.fft.dctn(-divergence, type=2, norm="ortho") / eigenvalues
    spectrum[0, 0] = 0.0
    return np.asarray(scipy.fft.idctn(spectrum, type=2, norm="ortho"))
