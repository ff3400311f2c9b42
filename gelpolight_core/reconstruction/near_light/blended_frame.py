"""Frames of which a share is the frame before, as temporal noise reduction leaves it.

No contact was in the frame before: walls look too gentle, and all heights are too low. The share
is found in shadows, or from the light that no surface explains.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.health.contact_residual import ContactLightResidual, lacking_contrast
from gelpolight_core.health.fault_limits import SIGMAS
from gelpolight_core.reconstruction.height_map import COARSE

from .effort_parameters import RESOLVED
from .region_solution import SolvedRegion, solution_residual
from .sensor_maps import SensorMaps
from .shadow_floor import MOST, ShadowFloor, shadow_floor

TRIALS = 3
"""Solutions without the share that the one before lacks, at most."""


class RegionSolve(Protocol):
    """Solves a frame without a share of the frame before."""

    def __call__(self, share: float, *, trial: bool = False) -> SolvedRegion:
        """Return the solved region, in buffers that the next call overwrites."""


@dataclass(frozen=True, slots=True)
class UnblendedSolution:
    """A solved region without the frame before.

    Attributes
    ----------
    solved : SolvedRegion
        The region.
    residual : ContactLightResidual
        Light of the contact that it does not explain.
    share_sd : float
        Standard deviation of the share of the frame before; 0 where none was taken away.
    findings : tuple of Finding
        What was found about the contrast.
    """

    solved: SolvedRegion
    residual: ContactLightResidual
    share_sd: float = 0.0
    findings: tuple[Finding, ...] = ()


def without_frame_before(
    solve: RegionSolve, maps: SensorMaps, workers: RowThreadPool
) -> UnblendedSolution:
    """Solve a frame, again without the frame before if the contact shows it.

    Parameters
    ----------
    solve : callable
        Solves the frame.
    maps : SensorMaps
        Precomputed calibration data.
    workers : RowThreadPool
        Threads.
    """
    solved = solve(0.0)
    residual = solution_residual(solved, maps, workers)
    if maps.scale(COARSE).pitch_mm > RESOLVED * maps.full.decay_mm:
        return UnblendedSolution(solved, residual)  # nodes at quarter scale do not resolve walls
    floor, lacks = shadow_floor(solved, maps), 0.0
    if floor is None:
        lacks, sd = lacking_contrast(residual)
        if lacks > SIGMAS * sd:
            solved = _copied(solved)
            floor = _tried(solve, (maps, workers), lacks)
        else:
            lacks = 0.0
    if floor is not None and floor.is_clear:
        solved = solve(floor.share)
        residual = solution_residual(solved, maps, workers)
        return UnblendedSolution(solved, residual, floor.sd, (floor.finding,))
    return UnblendedSolution(solved, residual, findings=(_low_contrast(lacks),) if lacks else ())


def without_floor(ratio: Float32Array, share: float) -> Float32Array:
    """Return press over background without a share of the frame before."""
    return np.asarray((ratio - np.float32(share)) / np.float32(1.0 - share), np.float32)


def _tried(
    solve: RegionSolve, sensor: tuple[SensorMaps, RowThreadPool], lacks: float
) -> ShadowFloor | None:
    """Search for the share where walls are too gentle to turn away from an LED.

    Returns
    -------
    ShadowFloor or None
        The floor of the shadows, if it agrees with the light of the rest of the contact.
    """
    before, share = 0.0, min(lacks, MOST)
    for _ in range(TRIALS):
        solved = solve(share, trial=True)
        residual = solution_residual(solved, *sensor)
        left, sd = lacking_contrast(residual)
        if share == before or not abs(left) < abs(lacks):
            return None
        slope = (lacks - left) / (share - before)
        found, sd = share + left / slope, sd / slope
        floor = shadow_floor(solved, sensor[0], before=share)
        if abs(found - share) < sd:
            if floor is None:
                return None
            # Errors of the model, such as of light between parts, look like less contrast, too.
            together_sd = math.hypot(sd, floor.sd, residual.misfit)
            return floor if abs(floor.share - found) < SIGMAS * together_sd else None
        before, share, lacks = share, min(found, MOST), left
    return None


def _copied(solved: SolvedRegion) -> SolvedRegion:
    """Return a region in buffers of its own. Its scale is never written."""
    parts = solved._asdict()
    scale = parts.pop("scale")
    return SolvedRegion(scale=scale, **copy.deepcopy(parts))


def _low_contrast(share: float) -> Finding:
    """Return the finding on a contact that lacks contrast, without shadows that tell why."""
    text = (
        f"the walls of the contact lack {100.0 * share:.0f} % of their contrast: the camera blends "
        "in the frame before, or the stretched membrane is darker than in the calibration's presses"
    )
    remedy = (
        "Switch temporal noise reduction off; if it is off, press the balls again and calibrate"
    )
    heights = HeightReliability.DOUBTFUL
    return Finding(
        "low_contrast",
        text,
        100.0 * share,
        "%",
        verdict=Verdict.WARN,
        remedy=remedy,
        heights=heights,
    )
