"""The near-light rounds: repeated until they converge, with damping of long steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.sensor_calibration import FullModel

Map = NDArray[np.float32]
LONGEST_STEP = 0.2
"""A round may not move the surface by more than this share of the LEDs' height: light that is
frozen further away says next to nothing about the slopes there."""
HELD_ROUNDS = 10
"""Rounds at most, after a step was held back."""
SETTLED = 0.05
"""Share of the longest step below which held rounds have settled."""


@dataclass(frozen=True, slots=True)
class Rounds:
    """The depth after the rounds, and how they ended.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Along the rays.
    changes_mm : tuple of float
        Largest change of the depth in each round.
    stopped : str
        ``done``; ``damped`` when steps were limited and the rounds converged;
        ``grows`` when the last change was larger than the one before and that round was undone;
        ``unsettled`` when damped rounds did not end.
    """

    depth_mm: Map
    changes_mm: tuple[float, ...]
    stopped: str


def near_light_rounds(
    solve: Callable[[Map], Map],
    shape: tuple[int, ...],
    *,
    longest_mm: float,
    wanted: int,
    shallow_mm: float = 0.0,
) -> Rounds:
    """Repeat a round the wanted number of times, and after damping until the depth converges.

    Parameters
    ----------
    solve : function of the present depth (rows, columns)
        One round: returns the depth that the slopes at the present depth give.
    shape : tuple of int
        Of the depth, which starts at 0.
    longest_mm : float
        How far a round may move the surface.
    wanted : int
        Rounds.
    shallow_mm : float, optional
        One round is enough where it moves the surface by less.
    """
    depth = np.zeros(shape, np.float32)
    changes: list[float] = []
    stopped = "unsettled" if wanted else "done"
    for _ in range(HELD_ROUNDS if wanted else 0):
        solved = solve(depth)
        changes.append(float(np.abs(solved - depth).max()))
        if len(changes) > 1 and changes[-1] > changes[-2]:
            stopped = "grows"
            break
        depth = held_back(depth, solved, longest_mm)
        held = max(changes) > longest_mm
        enough = len(changes) >= wanted or changes[-1] < shallow_mm
        if enough and (not held or changes[-1] <= SETTLED * longest_mm):
            stopped = "damped" if held else "done"
            break
    return Rounds(depth, tuple(changes), stopped)


def longest_step_mm(full: FullModel) -> float:
    """Return how far one round may move the surface."""
    return LONGEST_STEP * float(np.abs(full.led_positions_mm[:, 2]).min())


def held_back(depth_mm: Map, solved_mm: Map, longest_mm: float) -> Map:
    """Return the solved depth, or a part of the step to it if the step is too long."""
    step = solved_mm - depth_mm
    longest = float(np.abs(step).max())
    if longest <= longest_mm:
        return solved_mm
    return np.asarray(depth_mm + np.float32(longest_mm / longest) * step)
