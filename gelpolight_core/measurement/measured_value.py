"""A measured value with its standard deviation from the errors of the map."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.compared_quantity import Quantity, value_text
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

from .interpolation import sample_bilinear
from .statistics import finite_or_none

MODEL_REACH_MM = 2.0 * TYPICAL_DECAY_MM
"""Correlation length of the model's depth errors: errors of slopes are correlated over about the
decay length of the drape, and their integral over twice that."""
WAVES = 24
"""Number of waves in one smooth example of the model's errors."""
LABELS = {
    "distance": "distance in the plane",
    "distance_3d": "distance in space",
    "level": "level of the width",
    "angle_3d": "angle in space",
    "roundness": "deviation from a circle, RMS",
    "side_a": "side",
    "side_b": "other side",
    "deepest": "deepest point",
    "ra": "roughness Ra of the line",
    "rq": "roughness Rq of the line",
    "rz": "roughness Rz of the line",
    "sa": "roughness Sa",
    "sq": "roughness Sq",
    "sz": "roughness Sz",
    "arc": "arc of the section",
    "drape_decay": "fall-off length",
}
"""What is shown for a name that says too little."""


@dataclass(frozen=True, slots=True)
class MeasuredValue:
    """One measured value.

    Attributes
    ----------
    value : float
        In `unit`.
    sd : float or None
        Standard deviation: the image's noise, the model and the calibration together. None
        where the height map states none. Points placed by a person have an uncertainty of one node.
        Errors of placing lines, rectangles and circles are not part of it.
    unit : str
        ``mm``, ``um`` or ``deg``.
    name : str
        Name for scripts, such as ``step_height``.
    """

    value: float
    sd: float | None
    unit: str
    name: str

    @property
    def label(self) -> str:
        """The name shown to the user."""
        return LABELS.get(self.name, self.name.replace("_", " "))

    @property
    def quantity(self) -> Quantity:
        """The value as it is compared with a reference and stored."""
        sd = None if self.sd is None else finite_or_none(self.sd)
        return Quantity(f"{self.name}_{self.unit}", self.value, sd)

    @property
    def text(self) -> str:
        """The value with its standard deviation."""
        return value_text(self.value, self.sd, self.unit)

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {"name": self.name, "value": self.value, "sd": self.sd, "unit": self.unit}


def named(
    figures: Iterable[MeasuredValue], compared: Iterable[Quantity]
) -> Iterator[tuple[str, Quantity]]:
    """Yield each figure with its label, compared with its reference where there is one."""
    remaining = {quantity.name: quantity for quantity in compared}
    for figure in figures:
        yield figure.label, remaining.pop(figure.quantity.name, figure.quantity)
    yield from (("mean side", rest) for rest in remaining.values() if rest.truth is not None)


@dataclass(frozen=True, slots=True)
class MapErrors:
    """Possible errors of the depths at some points.

    Attributes
    ----------
    depth_mm : (examples, N)
        Each row is one set of errors that belong together: noise and model.
    depth_scale_sd, lateral_scale_sd : float
        Relative standard deviations of depths and of lateral lengths, common to all points.
    """

    depth_mm: Float64Array
    depth_scale_sd: float
    lateral_scale_sd: float

    def sd_mm(self, depth_mm: Float64Array) -> Float64Array:
        """Return the standard deviation (N,) of depths (N,) at the places."""
        spread = np.mean(self.depth_mm**2, axis=0) + (self.depth_scale_sd * depth_mm) ** 2
        return np.asarray(np.sqrt(spread))


def errors_at(heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array) -> MapErrors | None:
    """Return errors at places of a height map, None where it states none.

    The noise comes from the examples in the map. The map states the size of the model's errors.
    They are assumed to be smooth over the drape's length, and are the same for all tools on a map.

    Parameters
    ----------
    heightmap : HeightMap
        Reconstructed with its uncertainty.
    x_mm, y_mm : (N,)
        Places.
    """
    if heightmap.noise_mm is None or heightmap.depth_model_sd_mm is None:
        return None
    examples = noise_at(heightmap, x_mm, y_mm)
    model_sd = value_at(heightmap, heightmap.depth_model_sd_mm, x_mm, y_mm)
    examples = examples + model_sd * _smooth_fields(len(examples), x_mm, y_mm)
    return MapErrors(examples, heightmap.depth_scale_sd or 0.0, heightmap.lateral_scale_sd or 0.0)


def noise_at(heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return examples (examples, N) of a map's noise at places.

    Parameters
    ----------
    heightmap : HeightMap
        The map, with examples of its noise, which are averages over blocks of nodes.
    x_mm, y_mm : (N,)
        Places.
    """
    assert heightmap.noise_mm is not None
    factor = round(heightmap.x_mm.size / heightmap.noise_mm.shape[2])
    column, row = index_of(heightmap, x_mm, y_mm)
    row, column = ((at - 0.5 * (factor - 1)) / factor for at in (row, column))
    return sample_bilinear(heightmap.noise_mm, row, column)


def noise_slopes_at(heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return the slopes (examples, 2, N) of examples of a map's noise at places.

    Parameters
    ----------
    heightmap, x_mm, y_mm
        As for :func:`noise_at`.
    """
    assert heightmap.noise_mm is not None
    examples = heightmap.noise_mm
    coarse_mm = heightmap.pitch_mm * round(heightmap.x_mm.size / examples.shape[2])
    down, along = (np.gradient(examples, coarse_mm, axis=axis) for axis in (1, 2))
    slopes = [
        noise_at(replace(heightmap, noise_mm=np.asarray(part, np.float32)), x_mm, y_mm)
        for part in (along, down)
    ]
    return np.stack(slopes, axis=1)


def measure_with_errors(
    name: str,
    unit: str,
    compute: Callable[[Float64Array, float], float],
    depth_mm: Float64Array,
    errors: MapErrors | None,
) -> MeasuredValue:
    """Measure, and repeat the measurement with each possible error of the depths.

    Parameters
    ----------
    name, unit : str
        As in :class:`MeasuredValue`.
    compute : callable (depth_mm, stretch) -> value
        The measurement, from depths (N,) and a factor on all lateral lengths.
    depth_mm : (N,)
        The depths.
    errors : MapErrors or None
        Errors of these depths.
    """
    value = compute(depth_mm, 1.0)
    if errors is None:
        return MeasuredValue(value, None, unit, name)
    moved = [compute(depth_mm + error, 1.0) - value for error in errors.depth_mm]
    scaled = compute(depth_mm * (1.0 + errors.depth_scale_sd), 1.0) - value
    stretched = compute(depth_mm, 1.0 + errors.lateral_scale_sd) - value
    noise = math.sqrt(float(np.mean(np.square(moved))))
    return MeasuredValue(value, math.hypot(noise, scaled, stretched), unit, name)


def lateral_length(
    heightmap: HeightMap, name: str, value: float, sd: float | None = None
) -> MeasuredValue:
    """Return a length across, with the standard deviation of placing and calibration.

    Parameters
    ----------
    heightmap : HeightMap
        What was measured on. Without its noise, there is no standard deviation.
    name : str
        As in :class:`MeasuredValue`.
    value : float
        In mm.
    sd : float, optional
        Standard deviation of placing its ends, in mm. Default: one node for each of the two.
    """
    share = heightmap.lateral_scale_sd
    if share is None or heightmap.noise_mm is None:
        return MeasuredValue(value, None, "mm", name)
    placing = math.sqrt(2.0) * heightmap.pitch_mm if sd is None else sd
    return MeasuredValue(value, math.hypot(placing, share * value), "mm", name)


def index_of(
    heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return fractional (column, row) of places.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    x_mm, y_mm : (...)
        Places in the sensor frame.
    """
    column = (np.asarray(x_mm, np.float64) - heightmap.x_mm[0]) / heightmap.pitch_mm
    row = (np.asarray(y_mm, np.float64) - heightmap.y_mm[0]) / heightmap.pitch_mm
    return column, row


def value_at(
    heightmap: HeightMap, values: NDArray[np.floating], x_mm: Float64Array, y_mm: Float64Array
) -> Float64Array:
    """Return the values of a map (rows, columns) at places, bilinear, beyond it the nearest.

    Parameters
    ----------
    heightmap : HeightMap
        The map whose grid `values` has.
    values : (rows, columns)
        What is read.
    x_mm, y_mm : (...)
        Places in the sensor frame.
    """
    column, row = index_of(heightmap, x_mm, y_mm)
    return sample_bilinear(values, row, column)


def depth_at(heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return the depth at places, bilinear, NaN outside the working area.

    Parameters
    ----------
    heightmap, x_mm, y_mm
        As for :func:`value_at`.
    """
    column, row = index_of(heightmap, x_mm, y_mm)
    # Only the part around the places: a line of a live map is sampled in every frame.
    part = tuple(map(_span, (row, column), heightmap.depth_mm.shape))
    outside = (heightmap.flags[part] & int(Flag.OUTSIDE)) != 0
    depth_mm = np.where(outside, np.nan, heightmap.depth_mm[part].astype(np.float64))
    at = np.stack([row - part[0].start, column - part[1].start])
    return np.asarray(map_coordinates(depth_mm, at, order=1, mode="constant", cval=np.nan))


def _span(index: Float64Array, size: int) -> slice:
    """Return the nodes of an axis around places on it, with one more on each side."""
    known = np.clip(index[np.isfinite(index)], 0.0, size - 1.0)
    if not known.size:
        return slice(0, 1)
    return slice(max(math.floor(known.min()) - 1, 0), min(math.ceil(known.max()) + 2, size))


def flags_at(heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array) -> NDArray[np.uint8]:
    """Return the flags of the nearest nodes, ``OUTSIDE`` beyond the map.

    Parameters
    ----------
    heightmap, x_mm, y_mm
        As for :func:`value_at`.
    """
    column, row = (np.round(index).astype(int) for index in index_of(heightmap, x_mm, y_mm))
    rows, columns = heightmap.flags.shape
    on_map = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
    flags = np.full(column.shape, int(Flag.OUTSIDE), np.uint8)
    flags[on_map] = heightmap.flags[row[on_map], column[on_map]]
    return flags


def _smooth_fields(examples: int, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return random fields (examples, N) of unit variance that are smooth over the model's reach.

    A sum of waves with Gaussian wave numbers has a Gaussian correlation.
    """
    random = np.random.default_rng(0)
    waves = random.standard_normal((examples, WAVES, 2)) / MODEL_REACH_MM
    phases = random.uniform(0.0, 2.0 * np.pi, (examples, WAVES, 1))
    positions = np.stack([x_mm, y_mm])
    fields = [np.cos(w @ positions + p).sum(axis=0) for w, p in zip(waves, phases, strict=True)]
    return np.asarray(np.sqrt(2.0 / WAVES) * np.array(fields))
