"""Characteristics of a sensor in the terms of ISO 25178-600 and -700, from an evaluation.

Each has an expanded uncertainty (k = 2), or states how much is missing to know it. Images of the
untouched membrane, which stands for the ideally flat surface, lie in the folder ``flat`` of the
presses; they are not those of the calibration, which are flat by definition.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from gelpolight_core.finding import Finding
from gelpolight_core.light.finding import refuse_meaningless
from gelpolight_core.measurement.press import LENGTHS, Press
from gelpolight_core.measurement.result import Truth
from gelpolight_core.measurement.statistics import finite_or_none
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.images import SUFFIXES, read_image, require_colour
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
FLAT = "flat"
LEAST_FLAT, LEAST_OBJECTS, LEAST_EDGES, LEAST_POSITIONS = 3, 3, 3, 4
"""One more than what the value itself needs, so that its scatter is known, too."""
HALF_RESPONSE = math.pi * math.sqrt(2.0 / math.log(2.0))
"""Period over standard deviation of a Gaussian blur that halves the height of a sine."""
OTHER_FORM = math.sqrt(12.0) / 0.60336
"""The same of the mean over a width. The blur of a map has a form between the two."""
SAME_AS_TWO = float(ndtr(2.0))
"""Share of the values below two standard deviations, which Student's factor keeps."""
UM = "\N{MICRO SIGN}m"


@dataclass(frozen=True, slots=True)
class Characteristic:
    """One characteristic of a sensor.

    Attributes
    ----------
    key : str
        Name for scripts.
    name : str
        Its term, with the symbol of the standard.
    unit : str
        Of value and uncertainty; empty for a ratio.
    value, expanded : float
        The value and its expanded uncertainty (k = 2); NaN where too little was measured.
    needed : str
        What is missing; empty where it is known.
    """

    key: str
    name: str
    unit: str
    value: float = math.nan
    expanded: float = math.nan
    needed: str = ""

    @property
    def finding(self) -> Finding:
        """The characteristic as a figure without a limit."""
        if self.needed:
            text = tr("{name}: too few, {needed}").format(name=self.name, needed=self.needed)
        else:
            text = tr("{name}, U = {u:.2g} {unit}").format(
                name=self.name, u=self.expanded, unit=self.unit
            )
        return Finding(self.key, text.rstrip(), self.value, self.unit)

    def as_json(self) -> dict[str, Any]:
        """Return plain values; None for what is not known."""
        return {
            "key": self.key,
            "value": finite_or_none(self.value),
            "expanded_uncertainty": finite_or_none(self.expanded),
            "unit": self.unit,
            "needed": self.needed,
        }


def characteristics(
    results: Sequence[Press], flat_um: Sequence[Array] = ()
) -> tuple[Characteristic, ...]:
    """Return the characteristics of the sensor of an evaluation.

    Parameters
    ----------
    results : sequence of Press
        Measured presses of known objects.
    flat_um : sequence of (rows, columns) float64, optional
        From :func:`flat_maps`.
    """
    alpha = tr("Deviation from 1 of the amplification coefficient \N{GREEK SMALL LETTER ALPHA}")
    linearity = tr("Linearity deviation l")
    return (
        *_of_flat(flat_um),
        *_of_lengths(results, "depth", (f"{alpha}z", f"{linearity}z")),
        *_of_lengths(results, "planar", (f"{alpha}xy", f"{linearity}xy")),
        _mapping(results),
        _period_limit(results),
    )


def flat_maps(reconstructor: Reconstructor, presses: Path) -> tuple[Array, ...]:
    """Return the heights (micrometres) of the untouched membrane from its images beside presses.

    Parameters
    ----------
    reconstructor : Reconstructor
        Of the sensor.
    presses : Path
        Folder with a folder ``flat``, if there are such images. NaN is outside of the field.

    Raises
    ------
    InputError
        If an image cannot be read, or something is wrong with it.
    """
    found = []
    for path in sorted(p for p in (presses / FLAT).glob("[!.]*") if p.suffix.lower() in SUFFIXES):
        image = read_image(path, response=reconstructor.calibration.response)
        require_colour(image, where=str(path))
        health = reconstructor.health(image.rgb, name=path.name)
        refuse_meaningless(health, where=str(path))
        heightmap = reconstructor.depth(image.rgb, normals=False, everywhere=True, health=health)
        outside = heightmap.flags & np.uint8(Flag.OUTSIDE) != 0
        found.append(np.where(outside, np.nan, 1e3 * heightmap.depth_mm.astype(np.float64)))
    return tuple(found)


def _of_flat(maps_um: Sequence[Array]) -> tuple[Characteristic, Characteristic]:
    """Return the measurement noise, and the flatness deviation of the mean map."""
    noise = partial(Characteristic, "measurement_noise_um", tr("Measurement noise NM"), UM)
    flat = partial(Characteristic, "flatness_deviation_um", tr("Flatness deviation zFLT"), UM)
    if len(maps_um) < LEAST_FLAT:
        more = tr("{n} more images of the untouched membrane in the folder {folder}")
        needed = more.format(n=LEAST_FLAT - len(maps_um), folder=FLAT)
        return noise(needed=needed), flat(needed=needed)
    maps = np.array(maps_um)
    if not np.nan_to_num(maps).any():
        needed = tr("this model reads 0 where nothing is pressed")
        return noise(needed=needed), flat(needed=needed)
    count = len(maps)
    # Sq of each map less the mean of all, in which it has a share itself.
    share = math.sqrt(count / (count - 1))
    sq = share * np.nanstd(maps - maps.mean(axis=0), axis=(1, 2))
    mean_um = math.sqrt(float((sq**2).mean()))
    surface = _levelled(maps.mean(axis=0))
    # Both of its ends scatter.
    expanded = 2.0 * math.sqrt(2.0 / count) * mean_um
    return (
        noise(mean_um, 2.0 * float(sq.std(ddof=1)) / math.sqrt(count)),
        flat(float(np.nanmax(surface) - np.nanmin(surface)), expanded),
    )


def _levelled(surface: Array) -> Array:
    """Return a map less its plane."""
    rows, columns = np.nonzero(np.isfinite(surface))
    plane = np.stack([np.ones(rows.size), rows, columns], axis=1)
    solved = np.linalg.lstsq(plane, surface[rows, columns], rcond=None)[0]
    level = solved[0] + solved[1] * np.arange(surface.shape[0])[:, None]
    return np.asarray(surface - level - solved[2] * np.arange(surface.shape[1]))


def _of_lengths(
    results: Sequence[Press], direction: str, names: tuple[str, str]
) -> tuple[Characteristic, Characteristic]:
    """Return slope less 1 and largest deviation of the line of measured over true lengths.

    One object is one point: its presses share the error of its reference.
    """
    key = {"depth": "z", "planar": "xy"}[direction]
    slope = partial(Characteristic, f"amplification_{key}_percent", names[0], "%")
    deviation = partial(Characteristic, f"linearity_deviation_{key}_um", names[1], UM)
    found: dict[Truth, list[float]] = defaultdict(list)
    for press in results:
        if press.measurement is not None:
            found[press.truth].append(press.measured_mm(direction))
    true = np.array([float(getattr(truth, LENGTHS[direction])) for truth in found])
    missing = max(LEAST_OBJECTS - np.unique(true).size, 0)
    if missing:
        more = tr("{n} more heights") if direction == "depth" else tr("{n} more sizes")
        return slope(needed=more.format(n=missing)), deviation(needed=more.format(n=missing))
    measured = np.array([np.mean(values) for values in found.values()])
    parts = np.stack([np.ones_like(true), true])
    covariance = np.linalg.inv(parts @ parts.T)
    solved = covariance @ parts @ measured
    away_um = 1e3 * (measured - solved @ parts)
    sd_um = math.sqrt(float((away_um**2).sum()) / (true.size - 2))
    # The line itself follows a deviation in part.
    free = np.sqrt(1.0 - np.einsum("in,ij,jn->n", parts, covariance, parts))
    worst = int(np.argmax(np.abs(away_um)))
    k = float(stdtrit(true.size - 2, SAME_AS_TWO))
    return (
        slope(
            100.0 * (float(solved[1]) - 1.0), k * 0.1 * sd_um * math.sqrt(float(covariance[1, 1]))
        ),
        deviation(abs(float(away_um[worst])), k * sd_um * float(free[worst])),
    )


def _mapping(results: Sequence[Press]) -> Characteristic:
    """Return the largest x-y mapping deviation, after the stated positions are turned and moved."""
    named = partial(
        Characteristic,
        "mapping_deviation_xy_um",
        tr("x-y mapping deviation \N{GREEK CAPITAL LETTER DELTA}xy"),
        UM,
    )
    known = [
        (press.position_mm, press.measurement.centre_mm, press.position_sd_mm)
        for press in results
        if press.measurement is not None and math.isfinite(press.position_sd_mm)
    ]
    missing = LEAST_POSITIONS - len(known)
    if missing > 0:
        needed = tr("{n} more presses with x_mm, y_mm and position_sd_mm in {file}")
        return named(needed=needed.format(n=missing, file="truth.csv"))
    true, seen = (np.array([row[k] for row in known]) for k in (0, 1))
    true, seen = true - true.mean(axis=0), seen - seen.mean(axis=0)
    # The best rotation, by the polar form of complex numbers.
    at, found = true @ (1.0, 1.0j), seen @ (1.0, 1.0j)
    turn = np.vdot(at, found)
    away_um = 1e3 * np.abs(found - at * turn / abs(turn))
    reference_um = 1e3 * max(row[2] for row in known)
    # Scatter along one axis; three of the values follow from the rotation and the translation.
    scatter_um = math.sqrt(float((away_um**2).sum()) / (2 * len(known) - 3))
    return named(float(away_um.max()), 2.0 * math.hypot(reference_um, scatter_um))


def _period_limit(results: Sequence[Press]) -> Characteristic:
    """Return the lateral period limit, from the blur of the edges of cylinders and cuboids."""
    named = partial(
        Characteristic, "lateral_period_limit_mm", tr("Lateral period limit DLIM"), "mm"
    )
    blurs = [press.measurement.blur_mm for press in results if press.measurement is not None]
    periods = [HALF_RESPONSE * blur for blur in blurs if blur is not None]
    missing = LEAST_EDGES - len(periods)
    if missing > 0:
        return named(needed=tr("{n} more presses of a cylinder or cuboid").format(n=missing))
    period_mm = float(np.mean(periods))
    scatter_mm = float(np.std(periods, ddof=1)) / math.sqrt(len(periods))
    form_mm = (OTHER_FORM / HALF_RESPONSE - 1.0) * period_mm / math.sqrt(3.0)
    return named(period_mm, 2.0 * math.hypot(scatter_mm, form_mm))
