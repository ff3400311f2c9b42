"""Roughness of a region (Sa, Sq, Sz, ISO 25178-2) and of a profile (Ra, Rq, Rz, ISO 21920-2)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.geometry.fits import above_plane
from gelpolight_core.reconstruction.height_map import HeightMap

from .area import AreaNodes, Rectangle, nodes_inside
from .measured_value import MeasuredValue, errors_at, measure_with_errors
from .profile import Profile

Parameters = tuple[MeasuredValue, MeasuredValue, MeasuredValue]
UM = 1e3
ERROR_NODES = 2000
"""Nodes at which errors are propagated. More nodes give the same result and take more time."""
SECTIONS = 5
"""Sections of one cut-off each in the evaluation length, as ISO 21920-3 sets by default."""
ALPHA = math.sqrt(math.log(2.0) / math.pi)
"""Of the Gaussian filter: it passes half of a wave as long as the cut-off (ISO 16610-21)."""
LEAST_PITCHES = 5.0
"""With a shorter cut-off, the result would show the grid of the map."""


def roughness(heightmap: HeightMap, rectangle: Rectangle) -> Parameters:
    """Return Sa, Sq and Sz of a region in um.

    All nodes have the same weight. Only the least-squares plane is subtracted, without an S-filter
    or an L-filter: the resolution of the camera replaces the S-filter, and waviness within the
    region is included.

    Raises
    ------
    InputError
        If the region contains too few nodes.

    References
    ----------
    ISO 25178-2:2021, height parameters: Sa (arithmetical mean height), Sq (root mean square
    height), Sz (maximum height: maximum peak height plus maximum pit depth).
    """
    figure = area_estimator(heightmap, nodes_inside(heightmap, rectangle))

    def of_height(
        parameter: Callable[[Float64Array], float],
    ) -> Callable[[Float64Array, Float64Array, Float64Array], float]:
        return lambda x, y, depth: UM * parameter(above_plane(x, y, depth))

    return (
        figure("sa", "um", of_height(_mean)),
        figure("sq", "um", of_height(_rms)),
        figure("sz", "um", of_height(lambda z: float(np.ptp(z)))),
    )


def area_estimator(
    heightmap: HeightMap, nodes: AreaNodes
) -> Callable[
    [str, str, Callable[[Float64Array, Float64Array, Float64Array], float]], MeasuredValue
]:
    """Return the function that measures an area, from a name, a unit and a computation.

    The value is that of all nodes; errors are propagated at a part of them.

    Parameters
    ----------
    heightmap : HeightMap
        The map.
    nodes : AreaNodes
        Nodes of the area. A figure is computed from their x, y and depth in mm, (N,) each.
    """
    few = nodes.thinned(ERROR_NODES)
    errors = errors_at(heightmap, few.x_mm, few.y_mm)

    def figure(
        name: str, unit: str, compute: Callable[[Float64Array, Float64Array, Float64Array], float]
    ) -> MeasuredValue:
        def of_few(depth_mm: Float64Array, stretch: float) -> float:
            return compute(stretch * few.x_mm, stretch * few.y_mm, depth_mm)

        of_part = measure_with_errors(name, unit, of_few, few.depth_mm, errors)
        return replace(of_part, value=compute(nodes.x_mm, nodes.y_mm, nodes.depth_mm))

    return figure


def profile_roughness(profile: Profile, *, cutoff_mm: float = 0.8) -> Parameters:
    """Return Ra, Rq and Rz of a profile in um.

    The least-squares line is subtracted, then the Gaussian filter separates roughness from
    waviness. Half a cut-off at each end is not used, because the filter has too few neighbours
    there. There is no filter for the shortest waves (Nis): the camera's resolution replaces it.

    Parameters
    ----------
    profile : Profile
        From :func:`~gelpolight_core.measurement.profile.take_profile`.
    cutoff_mm : float, optional
        Longest wave that counts as roughness (Nic, formerly lambda c).

    Raises
    ------
    InputError
        If the line is too short for the cut-off, leaves the working area, or the cut-off is not
        longer than the map resolves.

    References
    ----------
    ISO 21920-2:2021 (Ra, Rq, Rz; Ra and Rz as in ISO 4287 for five sections), ISO 21920-3:2021
    (sections), ISO 16610-21:2011, Eq. (1) (Gaussian filter).
    """
    _check_cutoff(cutoff_mm, profile.pitch_mm)
    inside = _inside(profile)
    step, count = float(profile.along_mm[1] - profile.along_mm[0]), inside.stop - inside.start
    section = max(round(cutoff_mm / step), 1)
    sections = min((count - 2 * math.ceil(0.5 * section)) // section, SECTIONS)
    if sections < 1:
        text = f"a line of {step * count:.2f} mm is shorter than two cut-offs of {cutoff_mm:g} mm"
        raise InputError(text, "profile roughness", Remedy.DRAW_AGAIN)
    first = (count - sections * section) // 2
    errors = profile.errors and replace(profile.errors, depth_mm=profile.errors.depth_mm[:, inside])

    def figure(name: str, parameter: Callable[[Float64Array], float]) -> MeasuredValue:
        def compute(depths: Float64Array, stretch: float) -> float:
            rough = depths - _waves(depths, step, cutoff_mm)
            return UM * parameter(rough[first : first + sections * section])

        return measure_with_errors(name, "um", compute, profile.depth_mm[inside], errors)

    def rz(z: Float64Array) -> float:
        return float(np.mean(np.ptp(z.reshape(sections, section), axis=1)))

    return figure("ra", _mean), figure("rq", _rms), figure("rz", rz)


def _mean(height: Float64Array) -> float:
    return float(np.mean(np.abs(height)))


def _rms(height: Float64Array) -> float:
    return math.sqrt(float(np.mean(height**2)))


def gaussian_mean_line(depth_mm: Float64Array, step_mm: float, cutoff_mm: float) -> Float64Array:
    """Return the mean line of the Gaussian profile filter, (n,).

    Parameters
    ----------
    depth_mm : (n,)
        Finite depths at equal distances.
    step_mm, cutoff_mm : float
        Their distance, and the cut-off of the filter.

    References
    ----------
    ISO 16610-21:2011, Eq. (1): s(x) = exp(-pi (x / (alpha lambda_c))^2) / (alpha lambda_c). At the
    ends, the weights of the points that are there are scaled to a sum of 1.
    """
    reach = math.ceil(cutoff_mm / step_mm)
    x = np.arange(-reach, reach + 1) * step_mm
    weight = np.exp(-math.pi * (x / (ALPHA * cutoff_mm)) ** 2)
    # "same" keeps the longer of the two lengths.
    count = depth_mm.size
    total = np.convolve(depth_mm, weight)[reach : reach + count]
    weight_sum = np.convolve(np.ones(count), weight)[reach : reach + count]
    return np.asarray(total / weight_sum)


def _waves(depth_mm: Float64Array, step_mm: float, cutoff_mm: float) -> Float64Array:
    """Return the least-squares line plus the mean line of what is left."""
    x = np.arange(depth_mm.size) * step_mm
    slope, level = np.polyfit(x - x.mean(), depth_mm, 1)
    line = level + slope * (x - x.mean())
    return np.asarray(line + gaussian_mean_line(depth_mm - line, step_mm, cutoff_mm))


def _check_cutoff(cutoff_mm: float, pitch_mm: float) -> None:
    if math.isfinite(cutoff_mm) and cutoff_mm >= LEAST_PITCHES * pitch_mm:
        return
    text = (
        f"the cut-off is {cutoff_mm:g} mm, and {LEAST_PITCHES * pitch_mm:.2f} "
        "mm the least for this map (0.8 is usual)"
    )
    raise InputError(text, "profile roughness", Remedy.CORRECT_VALUE)


def _inside(profile: Profile) -> slice:
    """Return the part of a profile inside the working area."""
    valid = np.flatnonzero(np.isfinite(profile.depth_mm))
    whole = valid.size > 1 and valid.size == valid[-1] - valid[0] + 1
    if not whole:
        raise InputError(
            "the line crosses points without depth", "profile roughness", Remedy.DRAW_AGAIN
        )
    return slice(int(valid[0]), int(valid[-1]) + 1)
