"""Near-light rounds that are damped where they would move the surface too far."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.sensor.sensor_calibration import FullModel

LONGEST_STEP = 0.2
"""A round may not move the surface by more than this share of the LEDs' height: light that is
frozen further away says next to nothing about the slopes there."""
HELD_ROUNDS = 10
"""Rounds at most, after a step was held back."""
SETTLED = 0.05
"""Share of the longest step below which held rounds have settled."""
MOVED_MM = 5e-4
"""Rounds with interreflection end where one moves nothing by more."""
SMALLEST = 16
"""Nodes of the calibration's grid along an axis over whose mean a move counts. Single nodes at an
edge move back and forth between two normals that fit."""
MOST_GAIN = 0.95
"""A larger gain cannot be told from rounds that do not end."""


@dataclass(slots=True)
class DampedRounds:
    """Depth after the near-light rounds so far, with the reason for stopping.

    A round is repeated a number of times, and after damping until the depth converges.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Depth along the rays.
    longest_mm : float
        Longest step by which a round may move the surface.
    round_count : int
        Number of rounds.
    shallow_mm : float
        One round is enough where it moves the surface by less.
    changes_mm : list of float
        Largest change of the depth in each round.
    """

    depth_mm: Float32Array
    longest_mm: float
    round_count: int
    shallow_mm: float = 0.0
    changes_mm: list[float] = field(default_factory=list)
    _stopped: str = ""

    @property
    def stopped(self) -> str:
        """Reason for stopping, empty while rounds are to be done.

        ``done``; ``damped`` when steps were limited and the rounds converged;
        ``grows`` when the last change was larger than the one before and that round was undone;
        ``unsettled`` when damped rounds did not end.
        """
        return self._stopped or ("" if self.round_count else "done")

    def add(self, solved_mm: Float32Array) -> None:
        """Add a round: the depth that the slopes at the present depth give."""
        self.changes_mm.append(float(np.abs(solved_mm - self.depth_mm).max()))
        change_mm, count = self.changes_mm[-1], len(self.changes_mm)
        if count > 1 and change_mm > self.changes_mm[-2]:
            self._stopped = "grows"
            return
        self.depth_mm = limit_step(self.depth_mm, solved_mm, self.longest_mm)
        held = max(self.changes_mm) > self.longest_mm
        enough = count >= self.round_count or change_mm < self.shallow_mm
        if enough and (not held or change_mm <= SETTLED * self.longest_mm):
            self._stopped = "damped" if held else "done"
        elif count == HELD_ROUNDS:
            self._stopped = "unsettled"


@dataclass(slots=True)
class LightRounds:
    """Rounds with the light that the membrane reflects onto itself, until they move nothing.

    A membrane that is too flat reflects too little light onto itself, and looks flatter still: an
    error of the light grows to 1 / (1 - gain) of itself.

    Attributes
    ----------
    moved_mm : list of float
        Largest move of each round, as mean over `SMALLEST` nodes.
    settled : bool
        Whether no more round is needed.
    """

    moved_mm: list[float] = field(default_factory=list)
    settled: bool = False

    @property
    def gain(self) -> float:
        """Share of a move by which the next round moves, on average; 0 where one was enough."""
        first, last, rounds = self.moved_mm[0], self.moved_mm[-1], len(self.moved_mm) - 1
        if rounds == 0 or first <= MOVED_MM:
            return 0.0
        return min(float((last / first) ** (1.0 / rounds)), MOST_GAIN)

    @property
    def left_mm(self) -> float:
        """Depth that more rounds would still add."""
        return self.moved_mm[-1] * self.gain / (1.0 - self.gain)

    def add(self, move_mm: Float32Array, factor: int, most: int) -> None:
        """Add a round.

        Parameters
        ----------
        move_mm : (rows, columns) float32
            Its change of the depth.
        factor : int
            `PyramidLevel.factor` of its scale.
        most : int
            Rounds at most.
        """
        nodes = SMALLEST // factor
        size = tuple(max(n // nodes, 1) for n in move_mm.shape[::-1])
        means = cv2.resize(move_mm, size, interpolation=cv2.INTER_AREA)
        self.moved_mm.append(float(np.abs(means).max()))
        self.settled = self.moved_mm[-1] < MOVED_MM or len(self.moved_mm) >= most


def longest_step_mm(full: FullModel) -> float:
    """Return how far one round may move the surface."""
    return LONGEST_STEP * float(np.abs(full.led_positions_mm[:, 2]).min())


def limit_step(depth_mm: Float32Array, solved_mm: Float32Array, longest_mm: float) -> Float32Array:
    """Return the solved depth, or a part of the step to it if the step is too long."""
    step = solved_mm - depth_mm
    longest = float(np.abs(step).max())
    if longest <= longest_mm:
        return solved_mm
    return np.asarray(depth_mm + np.float32(longest_mm / longest) * step)
