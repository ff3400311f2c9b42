"""Gauge study of an evaluation: how far presses of the same object scatter."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.finding import Finding, QualityTable, Verdict
from gelpolight_core.measurement.statistics import (
    Statistics,
    missing_repeats,
    statistics_of,
    too_few_repeats,
)
from gelpolight_core.session.reference_object import ReferenceObject

from .evaluation import ALL, DIRECTIONS, Evaluation, by_object
from .reference_press import LENGTHS


@dataclass(frozen=True, slots=True)
class GaugeRow:
    """One object, or all of them, in one direction.

    Attributes
    ----------
    direction : str
        ``planar`` (its size) or ``depth`` (its height).
    truth : ReferenceObject or None
        The object; None: pooled over all objects.
    measured : Statistics
        The measured lengths in mm.
    repeatability_mm : float
        Standard deviation of a press about the mean of its object.
    missing : int
        How many repeats it lacks to be worth stating.
    """

    direction: str
    truth: ReferenceObject | None
    measured: Statistics
    repeatability_mm: float
    missing: int

    @property
    def shape(self) -> str:
        """Shape of the object, or ``all``."""
        return ALL if self.truth is None else self.truth.shape

    @property
    def true_mm(self) -> float:
        """The true length, NaN for all objects."""
        return float(getattr(self.truth, LENGTHS[self.direction], math.nan))


def gauge_rows(evaluation: Evaluation) -> tuple[GaugeRow, ...]:
    """Return the gauge table: all objects, then by size (planar) or by height (depth).

    Parameters
    ----------
    evaluation : Evaluation
        Evaluation of presses. Objects that are measured once are left out.
    """
    rows = []
    for direction in DIRECTIONS:
        lengths_by_object = {}
        objects = by_object(evaluation.series(direction))
        for truth in sorted(objects, key=lambda t: (t.shape, t.size_mm, t.height_mm)):
            lengths = [press.measured_mm(direction) for press in objects[truth]]
            measured_mm = [length for length in lengths if math.isfinite(length)]
            if len(measured_mm) > 1:
                lengths_by_object[truth] = measured_mm
        if lengths_by_object:
            rows.append(_row(direction, None, list(lengths_by_object.values())))
        rows += [_row(direction, truth, [lengths]) for truth, lengths in lengths_by_object.items()]
    return tuple(rows)


def gauge_figures(rows: Iterable[GaugeRow]) -> QualityTable:
    """Return the repeatability over all objects, or how many presses it lacks."""
    return QualityTable(
        tuple(
            Finding(
                f"{row.direction}_repeatability",
                f"Repeatability, {row.direction}, all objects",
                1e3 * row.repeatability_mm,
                "\N{MICRO SIGN}m",
                verdict=Verdict.WARN if row.missing else Verdict.PASS,
                remedy=too_few_repeats(row.missing),
            )
            for row in rows
            if row.truth is None
        )
    )


def _row(
    direction: str, truth: ReferenceObject | None, objects: Sequence[Sequence[float]]
) -> GaugeRow:
    """Return the scatter of presses about the mean of their object, pooled over objects."""
    freedom = sum(len(values) - 1 for values in objects)
    squares = sum(float(np.var(values)) * len(values) for values in objects)
    return GaugeRow(
        direction,
        truth,
        statistics_of(value for values in objects for value in values),
        math.sqrt(squares / freedom),
        missing_repeats(freedom),
    )
