"""How well a reconstructed surface explains its image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor


def solve_misfit(
    reconstructor: Reconstructor, frame: NDArray[Any], heightmap: HeightMap, *, largest: int = 200
) -> NDArray[np.float32]:
    """Return how far an image is from the image of its surface.

    Parameters
    ----------
    reconstructor : Reconstructor
        The reconstructor of the height map.
    frame : (height, width, 3)
        The raw image, as given to :meth:`Reconstructor.depth`.
    heightmap : HeightMap
        The surface; only its depth is used.
    largest : int, optional
        Most nodes per side.

    Returns
    -------
    (rows, columns) float32
        Root mean square over the channels of :meth:`Reconstructor.residual`, in units of the flat
        membrane's brightness, on a thinned grid; NaN where no channel is known.
    """
    step = max(-(-max(heightmap.depth_mm.shape) // largest), 1)
    left = reconstructor.residual(frame, heightmap, step=step)
    known = np.isfinite(left)
    square = np.where(known, left, 0.0) ** 2
    count = np.where(known.any(axis=-1), known.sum(axis=-1), np.nan)
    return np.asarray(np.sqrt(square.sum(axis=-1) / count), np.float32)
