"""Parameter sets of the near-light solver, one for each effort."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

RESOLVED = 0.5
"""Widest node by the drape's decay length: with nodes of 0.57 a cylinder of 1 mm is 4 % low, with
0.28 2 %."""


@dataclass(frozen=True, slots=True)
class EffortParameters:
    """Scale, tolerances and number of rounds by which an effort solves a frame.

    Attributes
    ----------
    factor : int
        Scale of the last round: nodes of the calibration's grid to a node, along an axis.
    round_tolerances : tuple of float
        Tolerances of the integrations at the coarsest scale, which only have to find where the
        surface is. The last one is used for all further rounds.
    tolerance : float
        Tolerance of the last integration.
    steps : int
        Gauss-Newton steps of a block of nodes, at most.
    settled : float
        Length of the step below which a block of nodes is done.
    most_rounds : int
        Last rounds at most, where the membrane reflects light onto itself.
    shallow_mm : float
        Depth up to which one near-light round is enough: a second one moves the surface by about
        twice its depth squared over the lights' height, here by less than half a micrometre.
    """

    factor: int
    round_tolerances: tuple[float, ...] = (0.05, 0.005)
    tolerance: float = 1e-3
    steps: int = 4
    settled: float = 3e-3
    most_rounds: int = 3
    shallow_mm: float = 0.05


SETTINGS: Mapping[str, EffortParameters] = MappingProxyType(
    {
        "fast": EffortParameters(4, most_rounds=1),
        "balanced": EffortParameters(2),
        "best": EffortParameters(1, (0.02, 0.002), 3e-4, 8, 5e-4, most_rounds=2),
    }
)

MOVED = EffortParameters(1, steps=3)
"""For normals that noise moves from their solution: one or two steps are enough."""
