"""Gauge study of an evaluation: repeatability within a region, reproducibility between regions."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gelpolight_core.finding import Finding, QualityTable, Verdict
from gelpolight_core.measurement.evaluation import (
    ALL,
    DIRECTIONS,
    RANDOM,
    SAME,
    Evaluation,
    by_object,
    region_kinds,
)
from gelpolight_core.measurement.press import LENGTHS, Press
from gelpolight_core.measurement.statistics import (
    Statistics,
    missing_repeats,
    statistics_of,
    too_few,
)
from gelpolight_core.reference import Truth

Lengths = list[list[float]]
"""Measured lengths (mm) of one object, one list for each region."""


@dataclass(frozen=True, slots=True)
class Scatter:
    """A standard deviation and what it rests on.

    Attributes
    ----------
    sd_mm : float
        The standard deviation; NaN if it is not known.
    freedom : int
        Its degrees of freedom.
    """

    sd_mm: float
    freedom: int

    @property
    def missing(self) -> int:
        """How many repeats it lacks to be worth stating."""
        return missing_repeats(self.freedom)


@dataclass(frozen=True, slots=True)
class GaugeRow:
    """One object, or all of them, in one direction.

    Attributes
    ----------
    direction : str
        ``planar`` (its size) or ``depth`` (its height).
    truth : Truth or None
        The object; None: pooled over all objects.
    same : Statistics
        Repeats in one region, or in each of several, in mm.
    repeatability : Scatter
        Of repeats about the mean of their region.
    random : Statistics
        One value for each of several regions: its press, or the mean of its repeats.
    reproducibility : Scatter
        What moving to another region adds to the repeatability; NaN if one of the two is not known.
    """

    direction: str
    truth: Truth | None
    same: Statistics
    repeatability: Scatter
    random: Statistics
    reproducibility: Scatter

    @property
    def shape(self) -> str:
        """Shape of the object, or ``all``."""
        return ALL if self.truth is None else self.truth.shape

    @property
    def true_mm(self) -> float:
        """The true length; NaN for all objects."""
        return float(getattr(self.truth, LENGTHS[self.direction], math.nan))


def gauge_rows(evaluation: Evaluation) -> tuple[GaugeRow, ...]:
    """Return the gauge table: all objects, then by size (planar) or by height (depth).

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
        found = {
            truth: (
                lengths_by_region(same.get(truth, []), direction),
                lengths_by_region(random.get(truth, []), direction),
            )
            for truth in objects
        }
        if found:
            rows.append(_row(direction, None, list(found.values())))
        rows += [_row(direction, truth, [lengths]) for truth, lengths in found.items()]
    return tuple(rows)


def gauge_figures(rows: Iterable[GaugeRow]) -> QualityTable:
    """Return repeatability and reproducibility over all objects, or how many presses they lack."""
    texts = {
        "repeatability": "Repeatability, {direction}, all objects",
        "reproducibility": "Reproducibility, {direction}, all objects",
    }
    figures = []
    for row in rows:
        for name, text in texts.items() if row.truth is None else ():
            scatter: Scatter = getattr(row, name)
            figures.append(
                Finding(
                    f"{row.direction}_{name}",
                    text.format(direction=row.direction),
                    1e3 * scatter.sd_mm,
                    "\N{MICRO SIGN}m",
                    verdict=Verdict.WARN if scatter.missing else Verdict.PASS,
                    remedy=too_few(scatter.missing),
                )
            )
    return QualityTable(tuple(figures))


def lengths_by_region(results: Iterable[Press], direction: str) -> Lengths:
    """Return the measured lengths (mm) of an object, one list for each position.

    Parameters
    ----------
    results : iterable of Press
        Of one object; presses without a region or a measurement are left out.
    direction : str
        ``planar`` (its size) or ``depth`` (its height).
    """
    regions: dict[str, list[float]] = defaultdict(list)
    for result in results:
        value = result.measured_mm(direction)
        # "random" is not one position: two such presses are not repeats of each other.
        if math.isfinite(value) and result.region:
            name = result.region
            key = f"{name} {result.file}" if name.lower() == "random" else name
            regions[key].append(value)
    return list(regions.values())


def _row(
    direction: str, truth: Truth | None, objects: Sequence[tuple[Lengths, Lengths]]
) -> GaugeRow:
    """Return one-way analysis of variance with regions as groups, pooled over objects."""
    repeated = [values for same, _ in objects for values in same]
    regions = [random for _, random in objects if len(random) > 1]
    within = sum(len(values) - 1 for values in repeated)
    squares = sum(float(np.var(values)) * len(values) for values in repeated)
    noise = squares / within if within else math.nan
    between = sum(len(random) - 1 for random in regions)
    # The means of few repeats scatter, too; only the excess is due to the position.
    excess = sum(
        (len(random) - 1)
        * (
            float(np.var([np.mean(values) for values in random], ddof=1))
            - noise * float(np.mean([1.0 / len(values) for values in random]))
        )
        for random in regions
    )
    added = math.sqrt(max(excess / between, 0.0)) if between and within else math.nan
    means = [float(np.mean(values)) for _, random in objects for values in random]
    return GaugeRow(
        direction,
        truth,
        statistics_of(value for values in repeated for value in values),
        Scatter(math.sqrt(noise), within),
        statistics_of(means),
        Scatter(added, between if within else 0),
    )
