"""Find the untouched part of the membrane and the change of its light.

A robust least-squares fit over cells: gain and room light of each channel, shift and blur. Cells
that do not follow the common change are pressed, dirty, or of another sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array
from gelpolight_core.base.compiling import whole

from .health_samples import PARAMETERS, HealthSamples
from .robust_fit import CORRELATED

TOLERANCES = np.array([0.03, 0.01, 0.006, 0.006])
"""Largest deviation of a cell's light from the common change, for each round."""
SIGMAS = 4.5
NEAR, FIRST = 0.012, 0.04
"""Tested limits for the change of light of the untouched part. The neighbours of a cell that
deviates by more than the first are left out, too: the drape reaches them."""
LEAST_NEAR = 0.15
"""Least share of the field within these limits; otherwise the common change can have any size
..."""
LEAST_START = 0.35
"""... and this share of the field must follow it. If a connected part of the first size looks as at
calibration, the light has not changed, and the rest is pressed, for example by a shallow face."""
PRECISION = np.array([0.5, 0.05, 0.5, 0.05, 0.5, 0.05, 4.0, 4.0, 8.0]) ** -2.0
"""Prior precision of the parameters."""
PAIRS = 1500
ROUGHEST = 9.0
"""A cell has another texture if the variance of its samples is larger than usual by this factor."""
AS_BEFORE_OFF = 0.4
"""Its light can have changed by this share of the assumed change."""
WITHOUT_OFFSETS = np.array([0, 2, 4, 6, 7, 8])
"""Room light and gain are hard to separate; without room light, the gain alone is more accurate."""


@dataclass(frozen=True, slots=True)
class GlobalChange:
    """The common change of the untouched membrane.

    Attributes
    ----------
    values, sd : (PARAMETERS,)
        Gain less 1 and offset (share of full scale) of each channel, shift in px along u and v,
        strength of the blur; with standard deviations.
    untouched : (cells,) bool
        Cells that follow it.
    change : (cells, 3)
        Remaining change of each cell's light, as a share.
    gain, gain_sd : (3,)
        Gain less 1 of each channel if the room light is as at calibration; standard deviations.
    """

    values: Float64Array
    sd: Float64Array
    untouched: BoolArray
    change: Float64Array
    gain: Float64Array
    gain_sd: Float64Array

    @property
    def share(self) -> float:
        """Fraction of cells that follow the common change, 0..1."""
        return float(self.untouched.mean()) if self.untouched.size else 0.0


def common_change(
    samples: HealthSamples, change: Float64Array, square: Float64Array, full: Float64Array
) -> GlobalChange:
    """Fit the common change of a frame.

    Parameters
    ----------
    samples : HealthSamples
        Samples of the background.
    change, square, full
        From :func:`~gelpolight_core.health.health_samples.compare_samples`.
    """
    # A saturated sample contains no information about the light.
    usable = full == 0.0
    values = np.zeros(PARAMETERS)
    light = change[:, :6:2] / samples.by_gain
    first = np.abs(light).max(axis=1)
    matching_mask = usable & (first < NEAR)
    _outer_part(samples.beside, matching_mask)
    if matching_mask.mean() < LEAST_NEAR:
        matching_mask = usable & (first < FIRST)
    small = matching_mask.mean() >= LEAST_NEAR
    if not small and usable.any():
        values = _gross(samples, change, usable)
        residual = np.empty((usable.size, 3))
        _remaining(samples.normal, change, values, residual)
        worst = np.abs(residual).max(axis=1)
        matching_mask = usable & (
            worst < max(FIRST, float(np.quantile(worst[usable], LEAST_START)))
        )
    sd, residual = np.full(PARAMETERS, np.inf), np.zeros((usable.size, 3))
    alone, alone_sd = np.zeros(WITHOUT_OFFSETS.size), np.full(WITHOUT_OFFSETS.size, np.inf)
    given = samples.normal, samples.count, samples.beside, change, square, usable
    estimates = values, sd, alone, alone_sd
    _rounds(*given, TOLERANCES, PRECISION, bool(small), *estimates, matching_mask, residual)
    before = _as_before(samples, light, light - residual) if small else None
    if before is not None:
        matching_mask = before
        _rounds(*given, TOLERANCES[-1:], PRECISION, True, *estimates, matching_mask, residual)
    elif not small and matching_mask.mean() < LEAST_START:
        matching_mask[:] = False
    return GlobalChange(values, sd, matching_mask, residual, alone[:3], alone_sd[:3])


def scatter_of_cells(samples: HealthSamples, common: GlobalChange) -> Float64Array:
    """Return the standard deviation (3,) of the untouched part's gain by the scatter of its cells.

    A press changes the light of neighbouring cells alike: each group of neighbours counts as one.
    """
    at, beside = common.untouched, samples.beside
    around = common.change.take(beside[at].T, axis=0).mean(axis=0)
    return np.asarray(around.std(axis=0) * math.sqrt(beside.shape[1] / at.sum()))


def _as_before(
    samples: HealthSamples, light: Float64Array, supposed: Float64Array
) -> BoolArray | None:
    """Return the part of the field with unchanged light, or None where it is too small.

    Parameters
    ----------
    samples : HealthSamples
        Samples of the background.
    light, supposed : (cells, 3)
        Change of each cell's light, and its part that the fit assigns to the common change.
    """
    size = float(np.abs(supposed).mean(axis=0).max())
    around = np.abs(light.take(samples.beside.T, axis=0).mean(axis=0)).max(axis=1)
    part = np.asarray(around < AS_BEFORE_OFF * size)
    _outer_part(samples.beside, part)
    return part if part.mean() > LEAST_NEAR else None


def _gross(samples: HealthSamples, change: Float64Array, usable: BoolArray) -> Float64Array:
    """Return gain and offset of each channel by the medians over pairs of cells."""
    values = np.zeros(PARAMETERS)
    first, second = np.random.default_rng(0).choice(np.flatnonzero(usable), (2, PAIRS))
    for k in range(3):
        total = samples.normal[:, 2 * k + 1, 2 * k + 1]
        light, off = samples.normal[:, 2 * k, 2 * k + 1] / total, change[:, 2 * k + 1] / total
        apart = light[second] - light[first]
        far = np.abs(apart) > 0.25 * np.median(light[usable])
        if far.sum() < PAIRS // 20:
            gain = float(np.median(off[usable] / light[usable]))
        else:
            gain = float(np.median((off[second] - off[first])[far] / apart[far]))
        values[2 * k : 2 * k + 2] = gain, float(np.median((off - gain * light)[usable]))
    return values


@whole(fastmath=True, forceinline=True)
def _remaining(normal, change, values, left):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write each cell's change of light (cells, 3) beyond the common one, as a share."""
    for c in range(left.shape[0]):
        for k in range(3):
            explained = 0.0
            for j in range(PARAMETERS):
                explained += normal[c, 2 * k, j] * values[j]
            left[c, k] = (change[c, 2 * k] - explained) / normal[c, 2 * k, 2 * k]


@whole()
def _outer_part(beside, kept):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Keep only the connected part with the longest share of the field's boundary.

    The middle of a flat contact looks nearly untouched.
    """
    cells = kept.size
    part, waiting = np.zeros(cells, np.int64), np.empty(cells, np.int64)
    number, best, most = 0, 0, -1
    for start in range(cells):
        if not kept[start] or part[start]:
            continue
        number += 1
        part[start], waiting[0] = number, start
        done, reached, rim = 0, 1, 0
        while done < reached:
            for near in beside[waiting[done]]:
                rim += near == waiting[done]
                if kept[near] and not part[near]:
                    part[near], waiting[reached] = number, near
                    reached += 1
            done += 1
        if rim * cells + reached > most:
            best, most = number, rim * cells + reached
    for c in range(cells):
        kept[c] &= part[c] == best


@whole(fastmath=True)
def _rounds(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    normal,
    count,
    beside,
    change,
    square,
    usable,
    tolerances,
    precision,
    connected,
    values,
    sd,
    alone,
    alone_sd,
    kept,
    left,
):
    """Fit and select the matching cells alternately. Write the last six arguments.

    With a large change, saturated cells can divide the field, so it need not be `connected`.
    Compiling whole arrays that are assigned to others would take half of the time.
    """
    cells, size = kept.size, PARAMETERS
    scatter, strong = np.empty(cells), np.empty(cells, np.bool_)
    for step in range(tolerances.size):
        if not kept.any():
            break
        matrix, right = np.diag(precision), np.zeros(size)
        for c in range(cells):
            if kept[c]:
                for i in range(size):
                    right[i] += change[c, i]
                    for j in range(size):
                        matrix[i, j] += normal[c, i, j]
        inverse = np.linalg.inv(matrix)
        np.dot(inverse, right, values)
        for c in range(cells):
            total = square[c]
            for i in range(size):
                explained = 0.0
                for j in range(size):
                    explained += normal[c, i, j] * values[j]
                total += values[i] * (explained - 2.0 * change[c, i])
            scatter[c] = total / (3.0 * count[c])
        usual = max(np.median(scatter[kept]), 1e-6)
        widen = CORRELATED * np.sqrt(usual)
        for i in range(size):
            sd[i] = widen * np.sqrt(inverse[i, i])
        if step == tolerances.size - 1:
            part = np.linalg.inv(matrix[WITHOUT_OFFSETS][:, WITHOUT_OFFSETS])
            np.dot(part, right[WITHOUT_OFFSETS], alone)
            for i in range(alone.size):
                alone_sd[i] = widen * np.sqrt(part[i, i])
        _remaining(normal, change, values, left)
        tolerance = tolerances[step]
        for c in range(cells):
            strong[c] = not usable[c]
            kept[c] = usable[c] and scatter[c] < ROUGHEST * usual
            for k in range(3):
                limit = tolerance + SIGMAS * widen / np.sqrt(normal[c, 2 * k, 2 * k])
                kept[c] &= abs(left[c, k]) < limit
                strong[c] |= abs(left[c, k]) > limit + max(NEAR, tolerance)
        for c in range(cells):
            if strong[c]:
                kept[c] = False
                for near in beside[c]:
                    kept[near] = False
        if connected:
            _outer_part(beside, kept)
