"""Gauge repeatability of an evaluation: object by object, within a region and between regions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gelpolight_core.measurement.evaluation import (
    DIRECTIONS,
    RANDOM,
    SAME,
    Evaluation,
    by_object,
    lengths_by_region,
    region_kinds,
    variance_between,
    variance_within,
)
from gelpolight_core.measurement.result import Truth


@dataclass(frozen=True, slots=True)
class Series:
    """Measured lengths of one object in one series of presses.

    Attributes
    ----------
    count : int
        Measured presses, or regions.
    mean_mm : float
        NaN without any.
    sd_mm : float
        Standard deviation; NaN where there are too few.
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
        Repeats in one region, or in each of several: their sd about the region's mean is the
        repeatability.
    random : Series
        One value for each of several regions: its press, or the mean of its repeats.
    reproducibility_mm : float
        Standard deviation between regions, in addition to the repeatability; NaN if one of the two
        is not known.
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
            by_object(evaluation.series(direction, kinds.get(kind, ()))) for kind in (SAME, RANDOM)
        )
        objects = sorted({*same, *random}, key=lambda t: (t.shape, t.size_mm, t.height_mm))
        for truth in objects:
            repeated = lengths_by_region(same.get(truth, []), direction)
            regions = lengths_by_region(random.get(truth, []), direction)
            rows.append(_row(direction, truth, repeated, regions))
    return tuple(rows)


def _row(
    direction: str, truth: Truth, repeated: list[list[float]], regions: list[list[float]]
) -> GaugeRow:
    within = variance_within(repeated)
    presses = [value for values in repeated for value in values]
    means = [float(np.mean(values)) for values in regions]
    added = math.nan
    if len(means) > 1 and math.isfinite(within):
        added = math.sqrt(max(variance_between(regions, within), 0.0))
    return GaugeRow(
        direction,
        truth,
        Series(len(presses), _mean(presses), math.sqrt(within)),
        Series(len(means), _mean(means), _sd(means)),
        added,
    )


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else math.nan


def _sd(values: list[float]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else math.nan
