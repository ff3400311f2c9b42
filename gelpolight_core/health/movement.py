"""Camera movement against the membrane that is too large for the fit.

The samples are compared with shifted positions: first on a coarse lattice of shifts, then on finer
ones about the best. From there the fit follows a shift, a turn and a zoom, step by step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import SATURATED

from .change_fit import ChangeModel, FrameSums
from .explanations import MOVED
from .global_change import LEAST_START, GlobalChange, common_change
from .health_samples import PARAMETERS, RUN, SHIFT_U, SHIFT_V, compare_samples

Lattice = tuple[int, int]
LATTICES: tuple[Lattice, ...] = ((64, 8), (4, 2), (1, 1))
"""Reach and step in px: within 4 px the membrane still looks like itself."""
FOLLOWED_PX = 1.5
"""Largest movement that the fit can follow."""
STEPS = 8
"""Most steps of the fit; it ends where one makes nothing better."""


class Movement(NamedTuple):
    """A movement of the membrane in the image.

    Attributes
    ----------
    px : (cells, 2)
        Along u and v, of each cell.
    sums : FrameSums
        Of the frame with the movement undone.
    common : GlobalChange
        Change of the light, with the movement undone.
    """

    px: Float64Array
    sums: FrameSums
    common: GlobalChange

    @property
    def size_px(self) -> float:
        """Root of the mean square over the cells."""
        return math.sqrt(float((self.px**2).sum(axis=1).mean()))


def search_movement(model: ChangeModel, raw: NDArray[Any], light: Float32Array) -> Movement | None:
    """Return the movement of the membrane in the image, or None if none explains it.

    Parameters
    ----------
    model : ChangeModel
        Explanations of the sensor's frames.
    raw : (height, width, 3) uint8 or uint16
        The frame.
    light : (3, levels) float32
        Linear light of every number.
    """
    samples = model.samples
    cells, runs = samples.count.size, samples.run_cell.size
    most = np.array(raw.shape[:2]) - 2
    cell = samples.run_cell.repeat(RUN)

    def moved(px: Float64Array) -> tuple[float, FrameSums]:
        """Return the difference between image and background after a movement, and the sums."""
        change, square, full = np.zeros((cells, PARAMETERS)), np.zeros(cells), np.zeros(cells)
        sums = FrameSums(change, square, full, np.zeros((3, runs)))
        # By whole pixels: between others, interpolation would take noise away.
        at = samples.corner + np.rint(px).astype(np.int32)[cell, ::-1]
        place = at.clip(0, most).astype(np.int32), samples.part
        background = samples.run_cell, samples.expected, samples.effects, samples.weight
        compare_samples(raw, light, np.float32(SATURATED), *place, *background, *sums)
        # Independent of pressed objects: the majority of cells decides.
        return float(np.median(square / samples.count)), sums

    middle = np.zeros(2)
    for reach, step in LATTICES:
        steps = range(-reach, reach + 1, step)
        shifts = [middle + np.array([i, j]) for i in steps for j in steps]
        middle = min(shifts, key=lambda px: moved(np.tile(px, (cells, 1)))[0])
    px = np.tile(middle, (cells, 1))
    _, sums = moved(px)
    fit = model.fit(sums, ("gain",))
    for _ in range(STEPS):
        rest = model.local(model.fit(sums, ("gain", MOVED)), (MOVED,))[:, [SHIFT_U, SHIFT_V]]
        _, left = moved(px + rest)
        closer = model.fit(left, ("gain",))
        if not closer.evidence(fit, 0) > 0.0:
            break
        px, sums, fit = px + rest, left, closer
    else:
        rest = np.zeros_like(px)
    if (np.hypot(*rest.T) < FOLLOWED_PX).all():
        px = px + rest
    common = common_change(samples, sums.change, sums.square, sums.full)
    return Movement(px, sums, common) if common.share > LEAST_START else None
