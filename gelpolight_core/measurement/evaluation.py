"""The paper's evaluation (section VI-B, Fig. 13): planar and depth errors of known objects."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.measurement.press import LENGTHS, Press
from gelpolight_core.measurement.result import Measurement, Truth
from gelpolight_core.measurement.statistics import Statistics, statistics_of
from gelpolight_core.translation import tr

PAPER_PERCENT = {"planar": 5.0, "depth": 8.0}
"""Mean errors that the paper reports for random regions."""
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
class Repeatability:
    """Gauge repeatability in one direction, pooled over all objects.

    Attributes
    ----------
    direction : str
        ``planar`` or ``depth``.
    within_region_mm : float
        Standard deviation of repeats at one place; NaN without repeats.
    between_regions_mm : float
        Standard deviation that moving to another place adds; NaN with one place only.
    """

    direction: str
    within_region_mm: float
    between_regions_mm: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The paper's protocol on one folder of presses.

    Attributes
    ----------
    results : tuple of Press
        Every press that has a true size, measured or not.
    groups : tuple of Group
        Statistics by direction, shape, dimension and regions.
    repeatability : tuple of Repeatability
        Empty where nothing was repeated.
    skipped : tuple of str
        Files of shapes without a size.
    crossing : Crossing or None
        Which presses count in which direction; None: all in both.
    flat_um : tuple of (rows, columns) float64
        Heights of the untouched membrane, from
        :func:`~gelpolight_core.measurement.characteristics.flat_maps`.
    """

    results: tuple[Press, ...]
    groups: tuple[Group, ...]
    repeatability: tuple[Repeatability, ...]
    skipped: tuple[str, ...] = ()
    crossing: Crossing | None = None
    flat_um: tuple[NDArray[np.float64], ...] = field(default=(), repr=False, compare=False)

    @property
    def failed(self) -> tuple[Press, ...]:
        """The presses that could not be measured."""
        return tuple(result for result in self.results if result.measurement is None)

    @property
    def failure(self) -> str:
        """How many presses could not be measured; empty if all could."""
        if not self.failed:
            return ""
        return tr("{failed} of {all} presses could not be measured").format(
            failed=len(self.failed), all=len(self.results)
        )

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
    return Evaluation(results, groups, _repeatability(results), tuple(skipped), crossing)


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


def _repeatability(results: Sequence[Press]) -> tuple[Repeatability, ...]:
    """Return one-way analysis of variance with regions as groups, pooled over the objects."""
    found = []
    for direction in DIRECTIONS:
        within, between = _variances(results, direction)
        if math.isfinite(within) or math.isfinite(between):
            found.append(Repeatability(direction, math.sqrt(within), math.sqrt(between)))
    return tuple(found)


def _variances(results: Sequence[Press], direction: str) -> tuple[float, float]:
    """Return the variances (mm**2) within a region and between regions."""
    objects = [lengths_by_region(own, direction) for own in by_object(results).values()]
    within = variance_within([region for regions in objects for region in regions])
    moved = [regions for regions in objects if len(regions) > 1]
    if not moved:
        return within, math.nan
    noise = 0.0 if math.isnan(within) else within
    degrees = sum(len(regions) - 1 for regions in moved)
    between = sum((len(regions) - 1) * variance_between(regions, noise) for regions in moved)
    return within, max(between / degrees, 0.0)


def variance_within(groups: Sequence[Sequence[float]]) -> float:
    """Return the pooled variance (mm**2) of repeats at one position; NaN without repeats.

    Parameters
    ----------
    groups : sequence of sequences of float
        Lengths (mm) by place, of one object or of several.
    """
    freedom = sum(len(values) - 1 for values in groups)
    squares = sum(float(np.var(values)) * len(values) for values in groups)
    return squares / freedom if freedom else math.nan


def variance_between(groups: Sequence[Sequence[float]], within: float) -> float:
    """Return the variance (mm**2) between positions; below 0 if there is none.

    Parameters
    ----------
    groups : sequence of sequences of float
        Lengths (mm) of one object, for two or more positions.
    within : float
        Variance (mm**2) of repeats at one place.
    """
    # The means of few repeats scatter, too; only the excess is due to the position.
    share = float(np.mean([1.0 / len(values) for values in groups]))
    return float(np.var([np.mean(values) for values in groups], ddof=1)) - share * within


def lengths_by_region(results: Iterable[Press], direction: str) -> list[list[float]]:
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
