"""Gauge repeatability of an evaluation: object by object, within a region and between regions."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from gelpolight_core.measurement.evaluation import (
    DIRECTIONS,
    RANDOM,
    SAME,
    Evaluation,
    PressResult,
    region_kinds,
)
from gelpolight_core.measurement.result import Truth


@dataclass(frozen=True, slots=True)
class Series:
    """Measured lengths of one object in one series of presses.

    Attributes
    ----------
    count : int
        Measured presses.
    mean_mm : float
        NaN without any.
    sd_mm : float
        Standard deviation; NaN with fewer than two.
    """

    count: int
    mean_mm: float
    sd_mm: float


@dataclass(frozen=True, slots=True)
class GaugeRow:
    """One object in one direction.

    Attributes
    ----------
    direction : str
        ``planar`` (its size) or ``depth`` (its height).
    truth : Truth
        The object.
    same : Series
        Repeats in one region: their sd is the repeatability.
    random : Series
        One press in each of several regions.
    reproducibility_mm : float
        Standard deviation that going to another region adds to the repeatability; NaN where one
        of the two is not known.
    """

    direction: str
    truth: Truth
    same: Series
    random: Series
    reproducibility_mm: float

    @property
    def true_mm(self) -> float:
        """The true length."""
        return self.truth.size_mm if self.direction == "planar" else self.truth.height_mm


def gauge_rows(evaluation: Evaluation) -> tuple[GaugeRow, ...]:
    """Return the gauge table: planar objects by size, then depth objects by height.

    Parameters
    ----------
    evaluation : Evaluation
        Of presses with regions; without them there are no rows.
    """
    kinds = region_kinds(evaluation.results)
    rows = []
    for direction in DIRECTIONS:
        same, random = (
            _by_object(evaluation.series(direction, kinds.get(kind, ()))) for kind in (SAME, RANDOM)
        )
        objects = sorted({*same, *random}, key=lambda t: (t.shape, t.size_mm, t.height_mm))
        for truth in objects:
            here = _series(same.get(truth, []), direction)
            there = _series(random.get(truth, []), direction)
            rows.append(GaugeRow(direction, truth, here, there, _added(here, there)))
    return tuple(rows)


def _by_object(results: tuple[PressResult, ...]) -> dict[Truth, list[PressResult]]:
    objects: dict[Truth, list[PressResult]] = defaultdict(list)
    for result in results:
        objects[result.press.truth].append(result)
    return objects


def _series(results: list[PressResult], direction: str) -> Series:
    found = [r.measurement for r in results if r.measurement is not None]
    values = np.array([m.size_mm if direction == "planar" else m.height_mm for m in found])
    return Series(
        int(values.size),
        float(values.mean()) if values.size else math.nan,
        float(values.std(ddof=1)) if values.size > 1 else math.nan,
    )


def _added(same: Series, random: Series) -> float:
    """Return what regions add: presses in different regions scatter by repeats too."""
    if math.isnan(same.sd_mm) or math.isnan(random.sd_mm):
        return math.nan
    return math.sqrt(max(random.sd_mm**2 - same.sd_mm**2, 0.0))
