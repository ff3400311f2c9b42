"""The paper's evaluation (section VI-B, Fig. 13): planar and depth errors of known objects."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.finding import Finding, QualityTable, Verdict, judge
from gelpolight_core.measurement.press import LENGTHS, Press
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.statistics import Statistics, statistics_of, too_few
from gelpolight_core.quantity import COVERAGE, REST, TOLERANCE_PERCENT, guarded
from gelpolight_core.reference import Truth

DIRECTIONS = tuple(LENGTHS)
SAME, RANDOM, ALL = "same region", "random regions", "all"


@dataclass(frozen=True, slots=True)
class Crossing:
    """The object that is in both of the paper's series of objects.

    Planar errors are those of objects of one height, depth errors those of objects of one size.
    With the other series included, this one size or height would have too much weight.

    Attributes
    ----------
    size_mm : float
        Size of all objects of the depth series.
    height_mm : float
        Height of all objects of the planar series.
    """

    size_mm: float
    height_mm: float

    def holds(self, truth: Truth, direction: str) -> bool:
        """Return whether an object belongs to the series of a direction.

        Parameters
        ----------
        truth : Truth
            Of the object.
        direction : str
            ``planar`` or ``depth``.
        """
        if direction == "planar":
            return math.isclose(truth.height_mm, self.height_mm, abs_tol=1e-6)
        return math.isclose(truth.size_mm, self.size_mm, abs_tol=1e-6)


@dataclass(frozen=True, slots=True)
class Group:
    """A statistic and what it is of.

    Attributes
    ----------
    direction : str
        ``planar`` or ``depth``.
    shape : str
        A shape, or ``all``.
    dimension_mm : float or None
        Nominal size (planar) or height (depth); None: all.
    regions : str
        ``same region``, ``random regions`` or ``all``.
    statistic : Statistics
        The errors in percent.
    """

    direction: str
    shape: str
    dimension_mm: float | None
    regions: str
    statistic: Statistics


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The paper's protocol on one folder of presses.

    Attributes
    ----------
    results : tuple of Press
        Every press that has a true size, measured or not.
    groups : tuple of Group
        Statistics by direction, shape, dimension and regions.
    skipped : tuple of str
        Files of shapes without a size.
    crossing : Crossing or None
        Which presses count in which direction; None: all in both.
    flat_um : tuple of (rows, columns) float64
        Heights of the untouched membrane, from
        :func:`~gelpolight_core.measurement.characteristics.flat_maps`.
    limits_percent : (float, float)
        Tolerances, planar and in depth.
    """

    results: tuple[Press, ...]
    groups: tuple[Group, ...]
    skipped: tuple[str, ...] = ()
    crossing: Crossing | None = None
    flat_um: tuple[NDArray[np.float64], ...] = field(default=(), repr=False, compare=False)
    limits_percent: tuple[float, float] = TOLERANCE_PERCENT

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The lines of the table of presses."""
        return [press.as_row(self.limits_percent) for press in self.results]

    @property
    def failed(self) -> tuple[Press, ...]:
        """The presses that could not be measured."""
        return tuple(result for result in self.results if result.measurement is None)

    @property
    def failure(self) -> str:
        """How many presses could not be measured; empty if all could."""
        if not self.failed:
            return ""
        return f"{len(self.failed)} of {len(self.results)} presses could not be measured"

    def overall(self, direction: str) -> Statistics:
        """Return the statistics of all presses that count in one direction."""
        return statistics_of(press.error_percent(direction) for press in self.series(direction))

    def series(self, direction: str, results: Sequence[Press] | None = None) -> tuple[Press, ...]:
        """Return those of `results` (by default all) that count in one direction.

        Parameters
        ----------
        direction : str
            ``planar`` or ``depth``.
        results : sequence of Press, optional
            To choose from.
        """
        return _series(self.results if results is None else results, direction, self.crossing)


def evaluate(
    rows: Sequence[Press],
    outcomes: Sequence[Measurement | str],
    *,
    skipped: Sequence[str] = (),
    crossing: Crossing | None = None,
) -> Evaluation:
    """Compare measurements with the truth.

    Parameters
    ----------
    rows : sequence of Press
        What was pressed.
    outcomes : sequence of Measurement or str
        For every row its measurement, or why there is none.
    skipped : sequence of str, optional
        Files without a true size, to be reported.
    crossing : Crossing, optional
        Of the series, where a protocol was pressed.
    """
    results = tuple(replace(row, outcome=o) for row, o in zip(rows, outcomes, strict=True))
    groups = _groups(results, crossing)
    return Evaluation(results, groups, tuple(skipped), crossing)


def region_kinds(results: Sequence[Press]) -> dict[str, list[Press]]:
    """Sort presses into the paper's two series.

    An object pressed several times in one region belongs to "same region" there; an object pressed
    in several regions enters "random regions", repeats included. A region named ``same`` or
    ``random`` belongs to the series of that name. Without a region column there is only ``all``.

    Parameters
    ----------
    results : sequence of Press
        All presses.
    """
    kinds: dict[str, list[Press]] = {ALL: list(results)}
    for presses in by_object(results).values():
        regions: dict[str, list[Press]] = defaultdict(list)
        for result in presses:
            if result.region:
                regions[result.region].append(result)
        for region, here in regions.items():
            name = region.lower()
            if name != "random" and (name == "same" or len(here) > 1):
                kinds.setdefault(SAME, []).extend(here)
            if name == "random" or (name != "same" and len(regions) > 1):
                kinds.setdefault(RANDOM, []).extend(here)
    return kinds


def _series(
    results: Sequence[Press], direction: str, crossing: Crossing | None
) -> tuple[Press, ...]:
    if crossing is None:
        return tuple(results)
    return tuple(r for r in results if crossing.holds(r.truth, direction))


def _groups(results: Sequence[Press], crossing: Crossing | None) -> tuple[Group, ...]:
    groups: list[Group] = []
    for regions, everything in region_kinds(results).items():
        for direction in DIRECTIONS:
            presses = _series(everything, direction, crossing)
            kinds: set[tuple[str, float | None]] = {(ALL, None)}
            for press in presses:
                kinds |= {(press.truth.shape, None)}
                kinds |= {(press.truth.shape, press.true_mm(direction))}
            for shape, dimension in sorted(kinds, key=lambda kind: (kind[0], kind[1] or 0.0)):
                errors = [
                    press.error_percent(direction)
                    for press in presses
                    if shape in (ALL, press.truth.shape)
                    and dimension in (None, press.true_mm(direction))
                ]
                groups.append(Group(direction, shape, dimension, regions, statistics_of(errors)))
    return tuple(groups)


def evaluation_errors(evaluation: Evaluation) -> QualityTable:
    """Return the mean errors, judged by the tolerances of the planar and the depth direction."""
    title = "Mean absolute error, {direction}"
    title_in = "Mean absolute error, {direction}, {regions}"
    figures = []
    for direction, limit in zip(DIRECTIONS, evaluation.limits_percent, strict=True):
        if not evaluation.series(direction):
            continue  # there is no press for this direction yet
        figures.append(_mean_error(evaluation, direction, title.format(direction=direction), limit))
        for group in evaluation.groups:
            overall = group.shape == ALL and group.dimension_mm is None and group.regions != ALL
            mean = group.statistic.mean_absolute
            if group.direction == direction and overall and math.isfinite(mean):
                regions = group.regions.replace(" ", "_")
                text = title_in.format(direction=direction, regions=group.regions)
                figures.append(judge(f"{direction}_{regions}", text, mean, "%"))
    references = (found for truth in by_object(evaluation.results) for found in truth.findings())
    return QualityTable((*figures, *dict.fromkeys(references)))


def _mean_error(evaluation: Evaluation, direction: str, text: str, limit: float) -> Finding:
    """Judge a mean absolute error: within the tolerance only where enough presses say so."""
    mean = evaluation.overall(direction)
    found = guarded(
        f"{direction}_mean",
        text,
        mean.mean_absolute,
        limit,
        _mean_expanded(evaluation, direction),
        remedy="Calibrate again, or check the worst presses",
    )
    if found.verdict is Verdict.FAIL or not mean.missing:
        return found
    return replace(found, verdict=Verdict.WARN, remedy=too_few(mean.missing))


def _mean_expanded(evaluation: Evaluation, direction: str) -> float:
    """Return the expanded uncertainty of a mean error in percent.

    Calibration, model and reference err alike in all presses; only the rest averages out.
    """
    found = [press.quantities().get(direction) for press in evaluation.series(direction)]
    common, own = [], []
    for quantity in filter(None, found):
        rows = dict(quantity.budget)
        scale = 100.0 * COVERAGE / abs(quantity.truth or math.nan)
        alike = [sd for source, sd in rows.items() if source not in (REST, "noise")]
        common.append(scale * math.hypot(*alike))
        own.append(scale * math.hypot(rows.get(REST, 0.0), rows.get("noise", 0.0)))
    count = max(len(own), 1)
    return math.hypot(sum(common) / count, math.hypot(*own) / count)


def errors_by_dimension(
    results: Sequence[Press], direction: str
) -> tuple[list[float], dict[tuple[str, int], NDArray[np.float64]]]:
    """Return the bars of the paper's Fig. 13.

    Parameters
    ----------
    results : sequence of Press
        Of one series.
    direction : str
        ``planar`` or ``depth``.

    Returns
    -------
    dimensions_mm : list of float
        Nominal sizes or heights.
    errors_percent : dict
        Absolute errors of each shape and index in `dimensions_mm`; no entry without a measurement.
    """
    dimensions = sorted({press.true_mm(direction) for press in results})
    bars: dict[tuple[str, int], list[float]] = defaultdict(list)
    for press in results:
        if press.measurement is not None:
            key = press.truth.shape, dimensions.index(press.true_mm(direction))
            bars[key].append(abs(press.error_percent(direction)))
    return dimensions, {key: np.array(errors) for key, errors in bars.items()}


def by_object(results: Sequence[Press]) -> dict[Truth, list[Press]]:
    """Return the presses of each object."""
    objects: dict[Truth, list[Press]] = defaultdict(list)
    for result in results:
        objects[result.truth].append(result)
    return objects
