"""Roughness of a profile with a cut-off: Ra, Rq and Rz of ISO 21920-2."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.measured import MapErrors, Measured, measured
from gelpolight_core.measurement.profile import Profile
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
UM = 1e3
SECTIONS = 5
"""Sections of one cut-off each in the evaluation length, as ISO 21920-3 sets by default."""
ALPHA = math.sqrt(math.log(2.0) / math.pi)
"""Of the Gaussian filter: it passes half of a wave as long as the cut-off (ISO 16610-21)."""
LEAST_PITCHES = 5.0
"""With a shorter cut-off, the result would show the grid of the map."""


@dataclass(frozen=True, slots=True)
class ProfileRoughness:
    """Roughness parameters of a profile.

    Attributes
    ----------
    ra, rq, rz : Measured
        Arithmetic mean and root mean square of the roughness profile over the evaluation length,
        and the mean over its sections of highest peak plus deepest pit; um.
    cutoff_mm : float
        Of the filter, and length of a section.
    sections : int
        Sections that the line has room for; 5 where it is long enough.
    along_mm : (n,)
        Places of the evaluation length along the line.
    roughness_mm, waviness_mm : (n,)
        Roughness and waviness separated by the filter.
    """

    ra: Measured
    rq: Measured
    rz: Measured
    cutoff_mm: float
    sections: int
    along_mm: Array
    roughness_mm: Array
    waviness_mm: Array

    @property
    def figures(self) -> tuple[Measured, Measured, Measured]:
        """Ra, Rq and Rz."""
        return self.ra, self.rq, self.rz


def profile_roughness(profile: Profile, *, cutoff_mm: float = 0.8) -> ProfileRoughness:
    """Return the roughness of a profile.

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
    step = float(profile.along_mm[1] - profile.along_mm[0])
    section = max(round(cutoff_mm / step), 1)
    room = (inside.stop - inside.start) - 2 * math.ceil(0.5 * section)
    sections = min(room // section, SECTIONS)
    if sections < 1:
        raise InputError(
            tr("a line of {length:.2f} mm is too short for a cut-off of {cutoff:g} mm").format(
                length=step * (inside.stop - inside.start), cutoff=cutoff_mm
            ),
            where=tr("profile roughness"),
            advice=tr("Draw a line of at least two cut-offs; six allow the standard evaluation"),
        )
    first = inside.start + (inside.stop - inside.start - sections * section) // 2
    used = slice(first, first + sections * section)
    errors = _part(profile.errors, inside)
    depth = profile.depth_mm[inside]
    central = slice(used.start - inside.start, used.stop - inside.start)

    def figure(name: str, parameter: Callable[[Array], float]) -> Measured:
        def compute(depths: Array, stretch: float) -> float:
            return UM * parameter((depths - _waves(depths, step, cutoff_mm))[central])

        return measured(name, "um", compute, depth, errors)

    waves = _waves(depth, step, cutoff_mm)
    return ProfileRoughness(
        ra=figure("ra", lambda z: float(np.mean(np.abs(z)))),
        rq=figure("rq", lambda z: math.sqrt(float(np.mean(z**2)))),
        rz=figure("rz", lambda z: float(np.mean(np.ptp(z.reshape(sections, section), axis=1)))),
        cutoff_mm=cutoff_mm,
        sections=int(sections),
        along_mm=profile.along_mm[used],
        roughness_mm=(depth - waves)[central],
        waviness_mm=waves[central],
    )


def gaussian_mean_line(depth_mm: Array, step_mm: float, cutoff_mm: float) -> Array:
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
    there = np.convolve(np.ones(count), weight)[reach : reach + count]
    return np.asarray(total / there)


def _waves(depth_mm: Array, step_mm: float, cutoff_mm: float) -> Array:
    """Return the least-squares line plus the mean line of what is left."""
    x = np.arange(depth_mm.size) * step_mm
    slope, level = np.polyfit(x - x.mean(), depth_mm, 1)
    line = level + slope * (x - x.mean())
    return np.asarray(line + gaussian_mean_line(depth_mm - line, step_mm, cutoff_mm))


def _check_cutoff(cutoff_mm: float, pitch_mm: float) -> None:
    if math.isfinite(cutoff_mm) and cutoff_mm >= LEAST_PITCHES * pitch_mm:
        return
    raise InputError(
        tr(
            "the cut-off is {cutoff:g} mm, but the points of the map are {pitch:.3f} mm apart"
        ).format(cutoff=cutoff_mm, pitch=pitch_mm),
        where=tr("profile roughness"),
        advice=tr("Choose at least {least:.2f} mm; 0.8 mm is usual").format(
            least=LEAST_PITCHES * pitch_mm
        ),
    )


def _inside(profile: Profile) -> slice:
    """Return the part of a profile inside the working area."""
    there = np.flatnonzero(np.isfinite(profile.depth_mm))
    whole = there.size > 1 and there.size == there[-1] - there[0] + 1
    if not whole:
        raise InputError(
            tr("the line crosses points without depth"),
            where=tr("profile roughness"),
            advice=tr("Draw it where the map has no gaps"),
        )
    return slice(int(there[0]), int(there[-1]) + 1)


def _part(errors: MapErrors | None, part: slice) -> MapErrors | None:
    if errors is None:
        return None
    return MapErrors(errors.depth_mm[:, part], errors.depth_scale_sd, errors.lateral_scale_sd)
