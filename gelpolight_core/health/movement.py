"""Camera movement against the membrane that is too large for the fit.

The samples are compared with shifted positions: first on a coarse lattice of shifts, then on finer
ones about the best. The fit finds the rest.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.membrane_masks import SATURATED

from .change_fit import FrameSums
from .global_change import LEAST_START, GlobalChange, common_change
from .health_samples import PARAMETERS, SHIFT_U, SHIFT_V, HealthSamples, compare_samples

Lattice = tuple[int, int]
LATTICES: tuple[Lattice, ...] = ((64, 8), (4, 2), (1, 1))
"""Reach and step in px: within 4 px the membrane still looks like itself."""
FOLLOWED_PX = 1.5
"""Largest movement that the fit can follow."""


class Movement(NamedTuple):
    """A movement of the membrane in the image.

    Attributes
    ----------
    px : (float, float)
        Along u and v.
    sums : FrameSums
        Of the frame with the nearest whole pixels undone.
    common : GlobalChange
        Change of the light, with the movement undone.
    """

    px: tuple[float, float]
    sums: FrameSums
    common: GlobalChange


def search_movement(
    samples: HealthSamples, raw: NDArray[Any], light: Float32Array
) -> Movement | None:
    """Return the movement of the membrane in the image, or None if no shift explains it.

    Parameters
    ----------
    samples : HealthSamples
        Samples of the background.
    raw : (height, width, 3) uint8 or uint16
        The frame.
    light : (3, levels) float32
        Linear light of every number.
    """
    cells, runs = samples.count.size, samples.run_cell.size
    change, square, full = np.zeros((cells, PARAMETERS)), np.zeros(cells), np.zeros(cells)
    background = samples.part, samples.run_cell, samples.expected, samples.effects, samples.weight
    sums = FrameSums(change, square, full, np.zeros((3, runs)))
    most = np.array(raw.shape[:2], np.int32) - 2

    def off(u: int, v: int) -> float:
        """Return the difference between image and background after a shift."""
        corner = np.clip(samples.corner + np.array([v, u], np.int32), 0, most)
        compare_samples(raw, light, np.float32(SATURATED), corner, *background, *sums)
        # Independent of pressed objects: the majority of cells decides.
        return float(np.median(square / samples.count))

    u, v = 0, 0
    for reach, step in LATTICES:
        steps = range(-reach, reach + 1, step)
        u, v = min(((u + i, v + j) for i in steps for j in steps), key=lambda at: off(*at))
    off(u, v)
    common = common_change(samples, change, square, full)
    if common.share <= LEAST_START:
        return None
    rest = common.values[[SHIFT_U, SHIFT_V]]
    if np.hypot(*rest) > FOLLOWED_PX:
        rest = np.zeros(2)
    return Movement((float(u + rest[0]), float(v + rest[1])), sums, common)
