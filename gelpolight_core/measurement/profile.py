"""A section through a height map, with its steps and widths."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float64Array, PointXY
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.reconstruction.height_map import HeightMap

from .measured_value import (
    MapErrors,
    MeasuredValue,
    depth_at,
    errors_at,
    flags_at,
    measure_with_errors,
)

STEP = 0.5
"""Distance of the profile's points, as a share of the map's pitch."""
ERROR_STEP = 4.0
"""The same for the errors: the map has them at every fourth node."""
MOST_POINTS = 20_000
"""Most points of a line; the map's diagonal has about 3000."""


@dataclass(frozen=True, slots=True)
class Profile:
    """Depth along a line, averaged across a width.

    Attributes
    ----------
    start_mm, end_mm : (float, float)
        Ends of the line, (x, y) in the sensor frame.
    along_mm : (n,)
        Distance from the start.
    depth_mm : (n,)
        NaN outside the map and its working area.
    depth_sd_mm : (n,) or None
        Standard deviation of `depth_mm`, the calibration's share included; None where the height
        map states none.
    flags : (n,) uint8
        Every flag that is set anywhere across the width.
    pitch_mm : float
        Distance of the map's nodes.
    errors : MapErrors or None
        Correlated errors of `depth_mm`, for figures of the profile.
    """

    start_mm: PointXY
    end_mm: PointXY
    along_mm: Float64Array
    depth_mm: Float64Array
    depth_sd_mm: Float64Array | None
    flags: NDArray[np.uint8]
    pitch_mm: float
    errors: MapErrors | None = None

    @property
    def points_mm(self) -> Float64Array:
        """(n, 2) places of the points, (x, y)."""
        share = self.along_mm / self.along_mm[-1]
        start, end = np.array(self.start_mm), np.array(self.end_mm)
        return np.asarray(start + share[:, None] * (end - start))


def take_profile(
    heightmap: HeightMap, start_mm: PointXY, end_mm: PointXY, *, width_mm: float = 0.0
) -> Profile:
    """Cut through a height map along a line.

    Parameters
    ----------
    heightmap : HeightMap
        What to cut.
    start_mm, end_mm : (float, float)
        Ends of the line, (x, y) in the sensor frame; they may lie outside the map.
    width_mm : float, optional
        Depths are averaged over this width across the line, as far as the map reaches.

    Raises
    ------
    InputError
        If the line has no length, no point on the map, or a bad width.
    """
    length = math.hypot(end_mm[0] - start_mm[0], end_mm[1] - start_mm[1])
    step = STEP * heightmap.pitch_mm
    _check_line(length, width_mm, step)
    along = np.linspace(0.0, length, math.ceil(length / step) + 1)
    x, y = _strip(start_mm, end_mm, along, _across(width_mm, step))
    depth = depth_at(heightmap, x.ravel(), y.ravel()).reshape(x.shape)
    valid_mask = np.isfinite(depth)
    count = valid_mask.sum(axis=0)
    if not count.any():
        raise InputError("the line lies outside the working area", "profile", Remedy.MOVE_INSIDE)
    total = np.where(valid_mask, depth, 0.0).sum(axis=0)
    mean = np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)
    flags = np.bitwise_or.reduce(flags_at(heightmap, x, y), axis=0)
    errors = _profile_errors(heightmap, start_mm, end_mm, along, width_mm)
    return Profile(
        start_mm=start_mm,
        end_mm=end_mm,
        along_mm=along,
        depth_mm=mean,
        depth_sd_mm=None if errors is None else errors.sd_mm(mean),
        flags=flags,
        pitch_mm=heightmap.pitch_mm,
        errors=errors,
    )


def _check_line(length: float, width_mm: float, step: float) -> None:
    good = math.isfinite(length) and math.isfinite(width_mm) and width_mm >= 0.0
    if not good or not 2.0 * step <= length <= MOST_POINTS * step:
        text = f"the line has no length or no valid width ({length:g} mm x {width_mm:g} mm)"
        raise InputError(text, "profile", Remedy.DRAW_AGAIN)


def _across(width_mm: float, step: float) -> Float64Array:
    """Return the offsets of the lines that are averaged: the middles of equal strips."""
    lines = min(max(math.ceil(width_mm / step), 1), MOST_POINTS)
    return width_mm * ((np.arange(lines) + 0.5) / lines - 0.5)


def _strip(
    start_mm: PointXY, end_mm: PointXY, along: Float64Array, across: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return x and y (lines, points) of a strip."""
    angle = math.atan2(end_mm[1] - start_mm[1], end_mm[0] - start_mm[0])
    x = start_mm[0] + along * math.cos(angle) - across[:, None] * math.sin(angle)
    y = start_mm[1] + along * math.sin(angle) + across[:, None] * math.cos(angle)
    return x, y


def _profile_errors(
    heightmap: HeightMap, start_mm: PointXY, end_mm: PointXY, along: Float64Array, width_mm: float
) -> MapErrors | None:
    """Return the errors of a profile. Fewer points are enough because errors are smooth."""
    step = ERROR_STEP * heightmap.pitch_mm
    few = np.linspace(0.0, along[-1], math.ceil(along[-1] / step) + 1)
    x, y = _strip(start_mm, end_mm, few, _across(width_mm, step))
    errors = errors_at(heightmap, x.ravel(), y.ravel())
    if errors is None:
        return None
    mean = errors.depth_mm.reshape(-1, *x.shape).mean(axis=1)
    examples = np.array([np.interp(along, few, example) for example in mean])
    return MapErrors(examples, errors.depth_scale_sd, errors.lateral_scale_sd)


def step_height(profile: Profile, first_mm: PointXY, second_mm: PointXY) -> MeasuredValue:
    """Return how much deeper the second part of a profile lies than the first.

    Parameters
    ----------
    profile : Profile
        From :func:`take_profile`.
    first_mm, second_mm : (float, float)
        Two ranges of `along_mm`; the mean depth of each counts.

    Raises
    ------
    InputError
        If a range holds no point of the map.
    """
    first, second = (_within(profile, part, 1) for part in (first_mm, second_mm))

    def compute(depth: Float64Array, stretch: float) -> float:
        return float(depth[second].mean() - depth[first].mean())

    return measure_with_errors("step_height", "mm", compute, profile.depth_mm, profile.errors)


def width_at(profile: Profile, level_mm: float | None = None) -> MeasuredValue:
    """Return the distance between the outermost points at which a profile crosses a level.

    Parameters
    ----------
    profile : Profile
        From :func:`take_profile`.
    level_mm : float, optional
        A depth. Default: half way between the least and the greatest depth.

    Raises
    ------
    InputError
        If the profile does not cross the level twice.

    Notes
    -----
    The error of a depth moves an end by itself over the slope there. Between nodes the surface is
    not known: each end lies anywhere within one.
    """
    start, end, _ = _crossings(profile, level_mm)

    def compute(depth: Float64Array, stretch: float) -> float:
        level = level_mm if level_mm is not None else _half_level(start, depth)
        return stretch * (end.position(depth, level) - start.position(depth, level))

    figure = measure_with_errors("width", "mm", compute, profile.depth_mm, profile.errors)
    if figure.sd is None:
        return figure
    return replace(figure, sd=math.hypot(figure.sd, math.sqrt(2.0 / 12.0) * profile.pitch_mm))


def width_ends(profile: Profile, level_mm: float | None = None) -> tuple[float, float, float]:
    """Return the two ends of a width along the profile, and the level in mm.

    Parameters and errors are those of :func:`width_at`.
    """
    start, end, level = _crossings(profile, level_mm)
    return start.position(profile.depth_mm, level), end.position(profile.depth_mm, level), level


@dataclass(frozen=True, slots=True)
class _LevelCrossing:
    """Crossing of a profile with a level, linear in depths and level."""

    index: int
    """Of the point before the crossing."""
    along_mm: float
    length_mm: float
    rise_mm: float
    extremes: tuple[int, int]
    """Points of least and greatest depth."""

    def position(self, depth: Float64Array, level_mm: float) -> float:
        """Return the position of the crossing, with the present slope of the profile there."""
        return self.along_mm + (level_mm - float(depth[self.index])) * self.length_mm / self.rise_mm


def _half_level(crossing: _LevelCrossing, depth: Float64Array) -> float:
    return 0.5 * float(depth[crossing.extremes[0]] + depth[crossing.extremes[1]])


def _crossings(
    profile: Profile, level_mm: float | None
) -> tuple[_LevelCrossing, _LevelCrossing, float]:
    """Return the outermost crossings and the level."""
    whole = (float(profile.along_mm[0]), float(profile.along_mm[-1]))
    points = np.flatnonzero(_within(profile, whole, 3))
    depth, along = profile.depth_mm[points], profile.along_mm[points]
    extremes = (int(points[depth.argmin()]), int(points[depth.argmax()]))
    level = 0.5 * float(depth.min() + depth.max()) if level_mm is None else level_mm
    above = depth > level
    crossings = np.flatnonzero(above[1:] != above[:-1])
    if crossings.size < 2 or above[0] != above[-1]:
        text = f"the profile does not cross {level:.4f} mm twice"
        if depth.min() == depth.max():
            text = "the membrane is flat along the line"
        raise InputError(text, "width of a profile", Remedy.DRAW_AGAIN)
    outermost = [
        _LevelCrossing(
            int(points[k]),
            float(along[k]),
            float(along[k + 1] - along[k]),
            float(depth[k + 1] - depth[k]),
            extremes,
        )
        for k in (crossings[0], crossings[-1])
    ]
    return outermost[0], outermost[1], level


def _within(profile: Profile, part_mm: PointXY, least: int) -> BoolArray:
    """Return which points lie in a range and on the map."""
    low, high = sorted(part_mm)
    along = profile.along_mm
    part = (along >= low) & (along <= high) & np.isfinite(profile.depth_mm)
    if int(part.sum()) < least:
        text = f"the range from {low:g} to {high:g} mm holds too few points of the map"
        raise InputError(text, f"profile of {along[-1]:.2f} mm", Remedy.LARGER_AREA)
    return np.asarray(part)
