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
from gelpolight_core.measurement.press import LENGTHS
from gelpolight_core.measurement.result import Truth
from gelpolight_core.measurement.statistics import Statistics, statistics_of


@dataclass(frozen=True, slots=True)
class GaugeRow:
    """One object in one direction.

    Attributes
    ----------
    direction : str
        ``planar`` (its size) or ``depth`` (its height).
    truth : Truth
        The object.
    same : Statistics
        Repeats in one region, or in each of several, in mm.
    repeatability_mm : float
        Their standard deviation about the mean of their region.
    random : Statistics
        One value for each of several regions: its press, or the mean of its repeats.
    reproducibility_mm : float
        Standard deviation between regions, in addition to the repeatability; NaN if one of the two
        is not known.
    """

    direction: str
    truth: Truth
    same: Statistics
    repeatability_mm: float
    random: Statistics
    reproducibility_mm: float

    @property
    def true_mm(self) -> float:
        """The true length."""
        return float(getattr(self.truth, LENGTHS[self.direction]))


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
    added = math.nan
    if len(regions) > 1 and math.isfinite(within):
        added = math.sqrt(max(variance_between(regions, within), 0.0))
    return GaugeRow(
        direction,
        truth,
        statistics_of(value for values in repeated for value in values),
        math.sqrt(within),
        statistics_of(float(np.mean(values)) for values in regions),
        added,
    )
