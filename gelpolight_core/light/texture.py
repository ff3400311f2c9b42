"""Movement of the membrane in the image, measured from its texture and specks."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, rfft2

from gelpolight_core.masks import LEAST_LIGHT
from gelpolight_core.optics.resampling import ResamplingTable

Array = NDArray[np.float64]
Map = NDArray[np.float32]
Mask = NDArray[np.bool_]

TEXTURE_MM = 0.5
"""Largest size of specks and grain that show a shift."""
SMOOTH_PX = 1.5
"""Smoothing of the grain, in nodes."""
LEAST_PEAK = 8.0
"""Least height of a correlation peak, as a multiple of the scatter around it."""


def texture_shift_px(
    seen: Map, base: Map, usable: Mask, table: ResamplingTable
) -> tuple[float, float] | None:
    """Return how far the membrane's texture has moved in the camera's image.

    By phase correlation of the grain, which is independent of brightness and distribution of the
    light.

    Parameters
    ----------
    seen, base : (rows, columns, 3) float32
        Now and before, linear light on the grid.
    usable : (rows, columns) bool
        Nodes that are lit in both.
    table : ResamplingTable
        The grid and where its nodes are in the image.

    Returns
    -------
    (float, float) or None
        Along u and v, in raw pixels; None where there is too little texture.
    """
    grid = table.grid
    inside = np.asarray(cv2.erode(usable.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0)
    sigma = TEXTURE_MM / grid.pitch_mm
    window = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), sigma)
    parts = [rfft2(_texture(light, inside, sigma) * window) for light in (seen, base)]
    product = parts[0] * np.conj(parts[1])
    # Half whitened: otherwise, noise would dominate at the frequencies without texture.
    product /= np.sqrt(np.maximum(np.abs(product), 1e-20))
    peaks = irfft2(product, usable.shape)
    row, column = np.unravel_index(int(peaks.argmax()), peaks.shape)
    if not peaks.max() > LEAST_PEAK * float(np.std(peaks)):
        return None
    by_row = _vertex(*(float(peaks[(row + k) % peaks.shape[0], column]) for k in (-1, 0, 1)))
    by_column = _vertex(*(float(peaks[row, (column + k) % peaks.shape[1]]) for k in (-1, 0, 1)))
    moved = [
        (index + n // 2) % n - n // 2 + part
        for index, n, part in zip(
            (column, row), peaks.shape[::-1], (by_column, by_row), strict=True
        )
    ]
    i, j = (n // 2 for n in grid.shape)
    u_row, u_column, v_row, v_column = (
        float(across[i + 1, j] - across[i, j]) if down else float(across[i, j + 1] - across[i, j])
        for across in (table.u_px, table.v_px)
        for down in (True, False)
    )
    return (
        float(u_column * moved[0] + u_row * moved[1]),
        float(v_column * moved[0] + v_row * moved[1]),
    )


def _texture(light: Map, inside: Mask, sigma: float) -> Map:
    """Return the grain of an image: brightness over its own surroundings, less 1."""
    grey = np.where(inside, light.sum(axis=2), 0.0).astype(np.float32)
    share = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), sigma)
    around = cv2.GaussianBlur(grey, (0, 0), sigma) / np.maximum(share, 1e-6)
    grain = np.where(inside, grey / np.maximum(around, LEAST_LIGHT) - 1.0, 0.0)
    # A peak of a few nodes' width is a parabola at its top; a sharper one is not.
    return np.asarray(cv2.GaussianBlur(grain.astype(np.float32), (0, 0), SMOOTH_PX))


def _vertex(before: float, top: float, after: float) -> float:
    """Return where between -0.5 and 0.5 the parabola through three values has its top."""
    bend = before - 2.0 * top + after
    return 0.0 if bend >= 0.0 else min(max(0.5 * (before - after) / bend, -0.5), 0.5)
