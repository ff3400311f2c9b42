"""The fit of explanations to the untouched part of a frame, and the most likely of them.

The residual has two parts. The light of a cell is what its three gains explain: a press, and light
between parts of the membrane, change it, so that its variance is not known and follows from the
cells that fit best. The texture is the rest, whose variance is that of noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array

from .explanations import GAINS, MOST, OFFSETS, PRESSED, explanations
from .fault_limits import SIGMAS
from .health_samples import BLUR, RUN, RUNS_OF_CELL, SHIFT_U, SHIFT_V, HealthSamples
from .robust_fit import CORRELATED, robust_fit
from .row_light import QUARTILE, RowLight, fit_rows

ALIKE = 9.0
"""Cells whose light one error changes alike: a cell and its neighbours."""
LEAST_OF_FIRST = 0.1
"""Share of the evidence for the first explanation that a further one needs: models are linear."""
SAME = 0.1
"""Share within which channels change alike: an edge of a face changes them by their own angles."""
ROWS = "rows"
"""Key of the change by row, whose model is not one of the cells."""
BLOCK = 4 * RUN
"""Runs of a block of rows."""
FEW = 0.9
"""Blocks have changed by a step if a tenth of them have."""
FINE = (SHIFT_U, SHIFT_V, BLUR)
SURE = math.log(1000.0)
"""An explanation is taken if the frame is so many times more likely with it."""


class FrameSums(NamedTuple):
    """Sums of a frame, from :func:`~gelpolight_core.health.health_samples.compare_samples`."""

    change: Float64Array
    square: Float64Array
    full: Float64Array
    run_change: Float64Array


@dataclass(frozen=True, slots=True)
class ChangeFit:
    """The fit of some explanations.

    Attributes
    ----------
    keys : tuple of str
        The explanations.
    values : (p,)
        Their parameters, one explanation after the other.
    covariance : (p, p)
        Of the parameters.
    weight : (cells,)
        1 where a cell follows, 0 where it does not.
    light, texture : float
        Variance of the light of the cells and of the texture, over that of noise.
    unlikely : float
        How unlikely the light of a cell is, as the logarithm of a variance.
    """

    keys: tuple[str, ...]
    values: Float64Array
    covariance: Float64Array
    weight: Float64Array
    light: float
    texture: float
    unlikely: float

    def evidence(self, before: ChangeFit, more: int) -> float:
        """Return the logarithm of how much more likely the frame is than before.

        Parameters
        ----------
        before : ChangeFit
            Fit of fewer explanations.
        more : int
            Number of the further parameters.
        """
        cells = self.weight.size
        of_light = 0.5 * 3.0 * cells / ALIKE
        of_texture = of_light * RUNS_OF_CELL * RUN / CORRELATED**2
        gain = of_light * (before.unlikely - self.unlikely)
        gain += of_texture * math.log(before.texture / self.texture)
        return gain - 0.5 * more * math.log(max(3.0 * cells / ALIKE, 2.0))


@dataclass(frozen=True, slots=True)
class FrameChange:
    """What explains a frame.

    Attributes
    ----------
    fit : ChangeFit
        Of the gains and all explanations that make the frame more likely.
    rows : RowLight or None
        The change of the light by row, if that is one of them.
    worth : dict
        For each explanation but the gains, the logarithm of how much less likely the frame is
        without it; the most important first.
    instead : dict
        Another explanation that is as likely as this one, if there is one.
    sums : FrameSums
        What the change by row leaves.
    """

    fit: ChangeFit
    rows: RowLight | None
    worth: Mapping[str, float]
    instead: Mapping[str, str]
    sums: FrameSums

    @property
    def is_flicker(self) -> bool:
        """Whether only light by row has changed, in all channels alike or in a single one."""
        if self.rows is None or set(self.worth) != {ROWS}:
            return False
        shares = self.rows.shares
        least, middle, most = np.sort(np.abs(shares).max(axis=0))
        alike = np.ptp(shares, axis=1).max() < SAME * most
        return bool(alike or max(least, middle) < SAME * most)


class ChangeModel:
    """Explanations of one sensor's frames.

    Parameters
    ----------
    samples : HealthSamples
        Samples of its background.
    height : int
        Rows of its images.
    press : (cells, 3, 6), optional
        Changes of the light by a press of the whole field, if the LEDs' places are known.
    """

    def __init__(
        self, samples: HealthSamples, height: int, press: Float64Array | None = None
    ) -> None:
        self.samples, self._height = samples, height
        self._given = given = explanations(press)
        parts = [explanation.effects(samples) for explanation in given]
        ends = np.cumsum([0, *(part.shape[2] for part in parts)])
        self.at = {e.key: np.arange(*ends[i : i + 2]) for i, e in enumerate(given)}
        self.effects = np.concatenate(parts, axis=2)
        of_light = samples.normal[:, GAINS] @ self.effects
        self._by_gain = of_light / samples.by_gain[..., None]
        self._light = np.swapaxes(of_light, 1, 2) @ self._by_gain
        total = np.swapaxes(self.effects, 1, 2) @ samples.normal @ self.effects
        self._texture = total - self._light
        self._across = np.ascontiguousarray(np.swapaxes(self.effects, 1, 2))
        self._prior = np.repeat([e.sd**-2.0 for e in given], np.diff(ends))
        self._row = samples.corner[:, 0].reshape(-1, RUN).mean(axis=1)
        blocks = np.argsort(self._row, kind="stable")
        self._blocks = blocks[: blocks.size // BLOCK * BLOCK].reshape(-1, BLOCK)
        # What a change of the light of a run does to the sums of its cell.
        light = samples.expected.reshape(-1, RUN, 3, 1)
        self._of_run = (samples.effects.reshape(-1, RUN, 3, 5) * light).sum(axis=1)

    def fit(self, sums: FrameSums, keys: Sequence[str]) -> ChangeFit:
        """Fit explanations to a frame."""
        at, by_gain = self._columns(keys), self.samples.by_gain
        gains = sums.change[:, GAINS]
        light = (np.swapaxes(self._by_gain, 1, 2) @ gains[..., None])[..., 0]
        texture = (self._across @ sums.change[..., None])[..., 0] - light
        square = (gains**2 / by_gain).sum(axis=1)
        values, inverse = np.zeros(at.size), np.zeros((at.size, at.size))
        weight, scales = np.zeros(len(by_gain)), np.ones(3)
        known = at, self._light, self._texture, light, texture
        rest = square, sums.square - square, 3.0 * self.samples.count - 3.0, sums.full == 0.0
        robust_fit(*known, *rest, self._prior[at], values, inverse, weight, scales)
        return ChangeFit(tuple(keys), values, inverse, weight, *scales.tolist())

    def explain(self, sums: FrameSums, usual: Mapping[str, float]) -> FrameChange:
        """Return the explanations that make a frame more likely, added one by one.

        Parameters
        ----------
        sums : FrameSums
            Of the frame.
        usual : mapping
            Evidence for explanations that healthy presses reach; 0 for those that are not in it.
        """
        change = self._unexplained(sums)
        if not self._may_be_explained(change):
            return change
        worth: dict[str, float] = {}
        instead: dict[str, str] = {}
        while True:
            least = max(SURE, LEAST_OF_FIRST * max(worth.values(), default=0.0))
            further = [
                found
                for found in self._further(change)
                if found[0] > least and usual.get(found[1], 0.0) < math.inf
            ]
            # The best one explains the frame, also where it is another that is unusual.
            if not any(gain > least + usual.get(key, 0.0) for gain, key, _ in further):
                break
            most = max(found[0] for found in further)
            # Of those that are as likely, the first one of the list is the most usual.
            likely = [found for found in further if found[0] > most - SURE]
            gain, key, change = likely[0]
            worth[key] = gain
            if key == PRESSED:
                break
            rivals = [other for _, other, _ in likely if other != key]
            if rivals:
                instead[key] = rivals[0]
        if len(worth) > 1:
            worth = {key: self._loss(change, key, sums) for key in worth}
        order = sorted(worth, key=lambda key: -worth[key])
        return replace(change, worth={key: worth[key] for key in order}, instead=instead)

    def evidence(self, sums: FrameSums) -> dict[str, float]:
        """Return how much more likely a frame is with each explanation alone, as a logarithm."""
        found: dict[str, float] = {}
        for gain, key, _ in self._further(self._unexplained(sums)):
            found[key] = max(gain, found.get(key, 0.0))
        return found

    def local(self, fit: ChangeFit, keys: Iterable[str]) -> Float64Array:
        """Return the change of each cell's parameters (cells, PARAMETERS) by explanations."""
        values = np.zeros(self.effects.shape[2])
        values[self._columns(fit.keys)] = fit.values
        at = self._columns(keys)
        return np.asarray(self.effects[..., at] @ values[at])

    def without(self, sums: FrameSums, local: Float64Array) -> FrameSums:
        """Return the sums of a frame without a change of each cell's parameters."""
        explained = np.einsum("cij,cj->ci", self.samples.normal, local)
        square = sums.square - np.einsum("ci,ci->c", local, 2.0 * sums.change - explained)
        return sums._replace(change=sums.change - explained, square=square)

    def without_rows(self, sums: FrameSums, rows: RowLight) -> FrameSums:
        """Return the sums of a frame without a change of the light by row."""
        samples, cell = self.samples, self.samples.run_cell
        share = rows.at(self._row)
        change = sums.change.copy()
        less = share[..., None] * self._of_run
        for k in range(3):
            for to, part in zip((2 * k, 2 * k + 1, *FINE), less[:, k].T, strict=True):
                change[:, to] -= np.bincount(cell, part, minlength=len(change))
        by_light = self._of_run[..., 0]
        of_run = sums.run_change.T / samples.run_light.T * by_light
        square = (share * (2.0 * of_run - share * by_light)).sum(axis=1)
        return sums._replace(
            change=change,
            square=sums.square - np.bincount(cell, square, minlength=len(change)),
            run_change=sums.run_change - (share * samples.run_light.T).T,
        )

    def _unexplained(self, sums: FrameSums) -> FrameChange:
        return FrameChange(self.fit(sums, ("gain",)), None, {}, {}, sums)

    def _columns(self, keys: Iterable[str]) -> NDArray[np.intp]:
        at = [self.at[key] for key in keys]
        return np.concatenate(at) if at else np.zeros(0, np.intp)

    def _further(self, change: FrameChange) -> Iterator[tuple[float, str, FrameChange]]:
        """Yield how much more likely the frame is with each explanation that is left."""
        fit, sums = change.fit, change.sums
        for explanation in self._given:
            key, at = explanation.key, self.at[explanation.key]
            # Of a press of the whole field nothing is left to fit more to.
            if key in fit.keys or (key == PRESSED and len(fit.keys) > 1):
                continue
            more = self.fit(sums, (key,) if key == PRESSED else (*fit.keys, key))
            if explanation.is_possible(more.values[-at.size :]):
                yield more.evidence(fit, at.size), key, replace(change, fit=more)
        if change.rows is None and self.may_change_by_row(sums):
            # The part above or below a step alone can look like the membrane: all is tried, too.
            weights = fit.weight, np.asarray(sums.full == 0.0, np.float64)
            for weight, sudden in product(weights, (False, True)):
                rows = self._rows(change, weight, sudden=sudden)
                if rows is not None and rows.largest < MOST:
                    left = self.without_rows(sums, rows)
                    more = self.fit(left, fit.keys)
                    gain = more.evidence(fit, rows.shares.size)
                    yield gain, ROWS, replace(change, fit=more, rows=rows, sums=left)

    def _rows(self, change: FrameChange, weight: Float64Array, *, sudden: bool) -> RowLight | None:
        """Fit a change by row to what is left of the light of the runs."""
        samples = self.samples
        share = (change.sums.run_change / samples.run_light).T
        local = self.local(change.fit, change.fit.keys)
        expected = local[:, GAINS] + local[:, OFFSETS] / samples.cell_light
        cell = samples.run_cell
        known = self._row, share - expected[cell], weight[cell], self._height
        return fit_rows(*known, sudden=sudden)

    def _loss(self, change: FrameChange, key: str, sums: FrameSums) -> float:
        """Return the logarithm of how much less likely the frame is without an explanation."""
        if key == ROWS:
            assert change.rows is not None
            left = self.fit(sums, change.fit.keys)
            return change.fit.evidence(left, change.rows.shares.size)
        keys = [other for other in change.fit.keys if other != key]
        return change.fit.evidence(self.fit(change.sums, keys), self.at[key].size)

    def _may_be_explained(self, change: FrameChange) -> bool:
        """Return whether a small step of any explanation would make a frame more likely."""
        fit, sums = change.fit, change.sums
        usable = fit.weight > 0.0
        if not usable.any():
            return False
        by_light, by_texture = (fit.weight / CORRELATED**2 / s for s in (fit.light, fit.texture))
        gains = sums.change[:, GAINS]
        light = np.einsum("ckp,ck,c->p", self._by_gain, gains, by_light - by_texture)
        score = light + np.einsum("cip,ci,c->p", self.effects, sums.change, by_texture)
        matrix = np.tensordot(by_light, self._light, 1) + np.tensordot(by_texture, self._texture, 1)
        gain = self.at["gain"]
        score = score - matrix[:, gain] @ fit.values
        matrix = matrix + np.diag(self._prior)
        for key, at in self.at.items():
            if key not in ("gain", PRESSED):
                cross = matrix[np.ix_(at, gain)] @ np.linalg.inv(matrix[np.ix_(gain, gain)])
                own = matrix[np.ix_(at, at)] - cross @ matrix[np.ix_(gain, at)]
                if score[at] @ np.linalg.solve(own, score[at]) > 2.0 * ALIKE * SURE:
                    return True
        return self.may_change_by_row(sums)

    def may_change_by_row(self, sums: FrameSums) -> bool:
        """Return whether medians of blocks of rows differ by more than their noise.

        Most do by flicker. By a step at the border, few do: by more than a contact would, too.
        """
        share = (sums.run_change / self.samples.run_light).T[self._blocks]
        median = np.median(share, axis=1)
        within = np.median(np.abs(share - median[:, None]), axis=(0, 1)) / QUARTILE
        # Of a median of independent values.
        sd = np.sqrt(0.5 * math.pi / share.shape[1]) * within
        most, few = np.quantile(np.abs(median - np.median(median, axis=0)), (0.5, FEW), axis=0)
        limit = SIGMAS * NormalDist().inv_cdf(0.5 * (1.0 + FEW)) * math.sqrt(ALIKE)
        return bool((most > SIGMAS * QUARTILE * sd).any() or (few > limit * sd).any())
