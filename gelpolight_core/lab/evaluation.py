"""The paper's evaluation (section VI-B, Fig. 13): planar and depth errors of known objects."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.compared_quantity import COVERAGE, REST, TOLERANCE_PERCENT, guarded
from gelpolight_core.base.finding import Finding, QualityTable, Verdict
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.statistics import Statistics, statistics_of, too_few_repeats
from gelpolight_core.session.reference_object import ReferenceObject

from .reference_press import LENGTHS, ReferencePress

DIRECTIONS = tuple(LENGTHS)
ALL = "all"


@dataclass(frozen=True, slots=True)
class GroupStatistics:
    """Error statistics of a group of presses (direction, shape, size).

    Attributes
    ----------
    direction : str
        ``planar`` or ``depth``.
    shape : str
        A shape, or ``all``.
    dimension_mm : float or None
        Nominal size (planar) or height (depth); None: all.
    statistic : Statistics
        The errors in percent.
    """

    direction: str
    shape: str
    dimension_mm: float | None
    statistic: Statistics


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The paper's evaluation on one folder of presses.

    Attributes
    ----------
    results : tuple of ReferencePress
        Every press that has a true size, measured or not.
    skipped : tuple of str
        Files of shapes without a size.
    flat_um : tuple of (rows, columns) float64
        Heights of the untouched membrane, from
        :func:`~gelpolight_core.lab.characteristics.flat_maps`.
    limits_percent : (float, float)
        Tolerances, planar and in depth.
    """

    results: tuple[ReferencePress, ...]
    skipped: tuple[str, ...] = ()
    flat_um: tuple[NDArray[np.float64], ...] = field(default=(), repr=False, compare=False)
    limits_percent: tuple[float, float] = TOLERANCE_PERCENT

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The lines of the table of presses."""
        return [press.as_row(self.limits_percent) for press in self.results]

    @property
    def groups(self) -> tuple[GroupStatistics, ...]:
        """Statistics by direction, shape and dimension."""
        return tuple(_groups(self))

    @property
    def failed(self) -> tuple[ReferencePress, ...]:
        """The presses that could not be measured."""
        return tuple(result for result in self.results if result.measurement is None)

    @property
    def failure(self) -> str:
        """Text on the number of presses that could not be measured. Empty if all could."""
        if not self.failed:
            return ""
        return f"{len(self.failed)} of {len(self.results)} presses could not be measured"

    def overall(self, direction: str) -> Statistics:
        """Return the statistics of all presses that count in one direction."""
        return statistics_of(press.error_percent(direction) for press in self.series(direction))

    def series(self, direction: str) -> tuple[ReferencePress, ...]:
        """Return the presses whose true length in a direction is stated.

        Parameters
        ----------
        direction : str
            ``planar`` or ``depth``.
        """
        return tuple(press for press in self.results if press.true_mm(direction))


def evaluate(
    rows: Sequence[ReferencePress],
    outcomes: Sequence[Measurement | str],
    *,
    skipped: Sequence[str] = (),
) -> Evaluation:
    """Compare measurements with the truth.

    Parameters
    ----------
    rows : sequence of ReferencePress
        What was pressed.
    outcomes : sequence of Measurement or str
        For every row its measurement, or why there is none.
    skipped : sequence of str, optional
        Files without a true size, to be reported.
    """
    results = tuple(replace(row, outcome=o) for row, o in zip(rows, outcomes, strict=True))
    return Evaluation(results, tuple(skipped))


def _groups(evaluation: Evaluation) -> Iterator[GroupStatistics]:
    for direction in DIRECTIONS:
        errors = defaultdict[tuple[str, float | None], list[float]](list, {(ALL, None): []})
        for press in evaluation.series(direction):
            shape, error = press.truth.shape, press.error_percent(direction)
            for kind, dimension in ((ALL, None), (shape, None), (shape, press.true_mm(direction))):
                errors[kind, dimension].append(error)
        for kind, dimension in sorted(errors, key=lambda group: (group[0], group[1] or 0.0)):
            yield GroupStatistics(
                direction, kind, dimension, statistics_of(errors[kind, dimension])
            )


def evaluation_errors(evaluation: Evaluation) -> QualityTable:
    """Return the mean errors, judged by the tolerances of the planar and the depth direction."""
    figures = [
        _mean_error(evaluation, direction, f"Mean absolute error, {direction}", limit)
        for direction, limit in zip(DIRECTIONS, evaluation.limits_percent, strict=True)
        if evaluation.series(direction)
    ]
    references = (
        finding for truth in by_object(evaluation.results) for finding in truth.findings()
    )
    return QualityTable((*figures, *dict.fromkeys(references)))


def _mean_error(evaluation: Evaluation, direction: str, text: str, limit: float) -> Finding:
    """Judge a mean absolute error: within the tolerance only where enough presses say so."""
    mean = evaluation.overall(direction)
    finding = guarded(
        f"{direction}_mean",
        text,
        mean.mean_absolute,
        limit,
        _mean_expanded(evaluation, direction),
        remedy="Calibrate again, or check the worst presses",
    )
    if finding.verdict is Verdict.FAIL or not mean.missing:
        return finding
    return replace(finding, verdict=Verdict.WARN, remedy=too_few_repeats(mean.missing))


def _mean_expanded(evaluation: Evaluation, direction: str) -> float:
    """Return the expanded uncertainty of a mean error in percent.

    Calibration, model and reference err alike in all presses; only the rest averages out.
    """
    quantities = [press.quantities().get(direction) for press in evaluation.series(direction)]
    common, independent = [], []
    for quantity in filter(None, quantities):
        rows = dict(quantity.budget)
        scale = 100.0 * COVERAGE / abs(quantity.truth or math.nan)
        alike = [sd for source, sd in rows.items() if source not in (REST, "noise")]
        common.append(scale * math.hypot(*alike))
        independent.append(scale * math.hypot(rows.get(REST, 0.0), rows.get("noise", 0.0)))
    count = max(len(independent), 1)
    return math.hypot(sum(common) / count, math.hypot(*independent) / count)


def errors_by_dimension(
    results: Sequence[ReferencePress], direction: str
) -> tuple[list[float], dict[tuple[str, int], NDArray[np.float64]]]:
    """Return the bars of the paper's Fig. 13.

    Parameters
    ----------
    results : sequence of ReferencePress
        With a true length in this direction.
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


def by_object(results: Sequence[ReferencePress]) -> dict[ReferenceObject, list[ReferencePress]]:
    """Return the presses of each object."""
    objects: dict[ReferenceObject, list[ReferencePress]] = defaultdict(list)
    for result in results:
        objects[result.truth].append(result)
    return objects
