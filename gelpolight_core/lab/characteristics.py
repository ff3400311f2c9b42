"""Characteristics of a sensor in the terms of ISO 25178-600 and -700, from an evaluation.

Each has an expanded uncertainty (k = 2), or states how much is missing to know it. Images of the
untouched membrane, which stands for the ideally flat surface, lie in the folder ``flat`` of the
presses; they are not those of the calibration, which are flat by definition.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr, stdtrit
from scipy.stats import linregress

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.finding import Finding
from gelpolight_core.geometry.fits import above_plane
from gelpolight_core.health.frame_health import refuse_meaningless
from gelpolight_core.image.image_file import files_in
from gelpolight_core.measurement.statistics import finite_or_none
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session_images import read_colours

from .reference_press import LENGTHS, ReferencePress

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


TERMS: Mapping[str, tuple[str, str]] = {
    "measurement_noise_um": ("Measurement noise NM", UM),
    "flatness_deviation_um": ("Flatness deviation zFLT", UM),
    "amplification_z_percent": (
        "Amplification coefficient \N{GREEK SMALL LETTER ALPHA}z less 1",
        "%",
    ),
    "linearity_deviation_z_um": ("Linearity deviation lz", UM),
    "amplification_xy_percent": (
        "Amplification coefficient \N{GREEK SMALL LETTER ALPHA}xy less 1",
        "%",
    ),
    "linearity_deviation_xy_um": ("Linearity deviation lxy", UM),
    "mapping_deviation_xy_um": (
        "x-y mapping deviation \N{GREEK CAPITAL LETTER DELTA}xy",
        UM,
    ),
    "lateral_period_limit_mm": ("Lateral period limit DLIM", "mm"),
}
"""Term of the standard, and unit, by the key for scripts."""


@dataclass(frozen=True, slots=True)
class Characteristic:
    """One characteristic of a sensor.

    Attributes
    ----------
    key : str
        Key of :data:`TERMS`.
    value, expanded : float
        The value and its expanded uncertainty (k = 2); NaN where too little was measured.
    needed : str
        What is missing; empty where it is known.
    """

    key: str
    value: float = math.nan
    expanded: float = math.nan
    needed: str = ""

    @property
    def finding(self) -> Finding:
        """The characteristic as a figure without a limit."""
        term, unit = TERMS[self.key]
        text = f"{term}, U = {self.expanded:.2g} {unit}"
        if self.needed:
            text = f"{term}: too few, {self.needed}"
        return Finding(self.key, text, self.value, unit)

    def as_json(self) -> dict[str, Any]:
        """Return plain values. None stands for what is not known."""
        return {
            "key": self.key,
            "value": finite_or_none(self.value),
            "expanded_uncertainty": finite_or_none(self.expanded),
            "unit": TERMS[self.key][1],
            "needed": self.needed,
        }


def characteristics(
    results: Sequence[ReferencePress], flat_um: Sequence[Float64Array] = ()
) -> tuple[Characteristic, ...]:
    """Return the characteristics of the sensor of an evaluation.

    Parameters
    ----------
    results : sequence of ReferencePress
        Measured presses of known objects.
    flat_um : sequence of (rows, columns) float64, optional
        From :func:`flat_maps`.
    """
    return tuple(
        chain(
            _of_flat(flat_um),
            _of_lengths(results, "depth", "z"),
            _of_lengths(results, "planar", "xy"),
            (_mapping(results), _period_limit(results)),
        )
    )


def flat_maps(reconstructor: Reconstructor, presses: Path) -> tuple[Float64Array, ...]:
    """Return the heights (micrometres) of the untouched membrane from its images beside presses.

    Parameters
    ----------
    reconstructor : Reconstructor
        The sensor's reconstructor.
    presses : Path
        Folder with a folder ``flat``, if there are such images. NaN is outside of the field.

    Raises
    ------
    InputError
        If an image cannot be read, or something is wrong with it.
    """
    maps_um = []
    for path in files_in(presses / FLAT).images:
        image = read_colours(path, response=reconstructor.calibration.response)
        health = reconstructor.health(image.rgb, name=path.name, loss=image.loss)
        refuse_meaningless(health, where=str(path))
        heightmap = reconstructor.depth(image.rgb, normals=False, everywhere=True, health=health)
        outside = heightmap.flags & np.uint8(Flag.OUTSIDE) != 0
        maps_um.append(np.where(outside, np.nan, 1e3 * heightmap.depth_mm.astype(np.float64)))
    return tuple(maps_um)


def _of_flat(maps_um: Sequence[Float64Array]) -> Iterator[Characteristic]:
    """Yield the measurement noise, and the flatness deviation of the mean map."""
    keys = "measurement_noise_um", "flatness_deviation_um"
    needed, count = "", len(maps_um)
    if count < LEAST_FLAT:
        more = LEAST_FLAT - count
        needed = f"{more} more images of the untouched membrane in the folder {FLAT}"
    elif not np.nan_to_num(maps_um).any():
        needed = "this model reads 0 where nothing is pressed"
    if needed:
        yield from (Characteristic(key, needed=needed) for key in keys)
        return
    mean = np.mean(maps_um, axis=0)
    # Sq of each map less the mean of all, in which it has a share itself.
    share = math.sqrt(count / (count - 1))
    sq = share * np.nanstd(np.array(maps_um) - mean, axis=(1, 2))
    noise_um = math.sqrt(float((sq**2).mean()))
    yield Characteristic(keys[0], noise_um, 2.0 * float(sq.std(ddof=1)) / math.sqrt(count))
    places = np.argwhere(np.isfinite(mean)).astype(np.float64)
    surface = above_plane(places[:, 1], places[:, 0], mean[np.isfinite(mean)])
    # Both of its ends scatter.
    yield Characteristic(keys[1], float(np.ptp(surface)), 2.0 * math.sqrt(2.0 / count) * noise_um)


def _of_lengths(
    results: Sequence[ReferencePress], direction: str, axis: str
) -> Iterator[Characteristic]:
    """Yield slope less 1 and largest deviation of the line of measured over true lengths.

    One object is one point: its presses share the error of its reference.
    """
    keys = f"amplification_{axis}_percent", f"linearity_deviation_{axis}_um"
    lengths_by_object: dict[ReferenceObject, list[float]] = defaultdict(list)
    for press in results:
        if press.measurement is not None and press.true_mm(direction):
            lengths_by_object[press.truth].append(press.measured_mm(direction))
    true = np.array([float(getattr(truth, LENGTHS[direction])) for truth in lengths_by_object])
    missing = LEAST_OBJECTS - np.unique(true).size
    if missing > 0:
        needed = f"{missing} more {'heights' if direction == 'depth' else 'sizes'}"
        yield from (Characteristic(key, needed=needed) for key in keys)
        return
    measured = np.array([np.mean(values) for values in lengths_by_object.values()])
    line, k = linregress(true, measured), float(stdtrit(true.size - 2, SAME_AS_TWO))
    yield Characteristic(keys[0], 100.0 * (line.slope - 1.0), k * 100.0 * line.stderr)
    away_um = 1e3 * np.abs(measured - line.intercept - line.slope * true)
    sd_um = math.sqrt(float((away_um**2).sum()) / (true.size - 2))
    worst = int(np.argmax(away_um))
    # The line itself follows a deviation in part.
    off = true - true.mean()
    free = 1.0 - 1.0 / true.size - off[worst] ** 2 / float((off**2).sum())
    yield Characteristic(keys[1], float(away_um[worst]), k * sd_um * math.sqrt(free))


def _mapping(results: Sequence[ReferencePress]) -> Characteristic:
    """Return the largest x-y mapping deviation, after the stated positions are turned and moved."""
    key = "mapping_deviation_xy_um"
    positions = [
        (complex(*press.position_mm), complex(*press.measurement.centre_mm), press.position_sd_mm)
        for press in results
        if press.measurement is not None and press.position_sd_mm is not None
    ]
    missing = LEAST_POSITIONS - len(positions)
    if missing > 0:
        needed = f"{missing} more presses with x_mm, y_mm and position_sd_mm in truth.csv"
        return Characteristic(key, needed=needed)
    # As complex numbers, of which the best rotation is one, too.
    true, measured, reference_mm = (np.array(column) for column in zip(*positions, strict=True))
    true, measured = true - true.mean(), measured - measured.mean()
    turn = np.vdot(true, measured)
    away_um = 1e3 * np.abs(measured - true * turn / abs(turn))
    # Scatter along one axis; three of the values follow from the rotation and the translation.
    scatter_um = math.sqrt(float((away_um**2).sum()) / (2 * len(positions) - 3))
    return Characteristic(
        key, float(away_um.max()), 2.0 * math.hypot(1e3 * reference_mm.max(), scatter_um)
    )


def _period_limit(results: Sequence[ReferencePress]) -> Characteristic:
    """Return the lateral period limit, from the blur of the edges of cylinders and cuboids."""
    key = "lateral_period_limit_mm"
    blurs = [press.measurement.blur_mm for press in results if press.measurement is not None]
    periods = [HALF_RESPONSE * blur for blur in blurs if blur is not None]
    missing = LEAST_EDGES - len(periods)
    if missing > 0:
        needed = f"{missing} more presses of a cylinder or cuboid"
        return Characteristic(key, needed=needed)
    period_mm = float(np.mean(periods))
    scatter_mm = float(np.std(periods, ddof=1)) / math.sqrt(len(periods))
    form_mm = (OTHER_FORM / HALF_RESPONSE - 1.0) * period_mm / math.sqrt(3.0)
    return Characteristic(key, period_mm, 2.0 * math.hypot(scatter_mm, form_mm))
