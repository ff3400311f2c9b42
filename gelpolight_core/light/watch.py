"""The health of a live sensor: persistent faults, and a gel that has not recovered yet."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.finding import Finding, Heights, Verdict
from gelpolight_core.light.finding import Health, health_of
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
LASTING_S = 0.4
"""A fault is shown once it was seen for so long, and in most frames."""
HOLD_S = 3.0
"""It is shown until it was not seen for so long: a stripe of rows comes back after seconds."""
REMEMBERED_S = 120.0
"""Gels recover within minutes."""
PRESSED = 0.3
"""A press shows with more of its strongest change than this; what is left of it shows with less."""
RECOVERED = 0.01
"""Share of the last press that may be left: 10 um of 1 mm."""
FALLS = 0.95
"""What recovers falls by more than this within `FALLS_S`; a lighter press does not."""
FALLS_S = 1.0
LEAST_CHANGE = 0.05
"""Change of a cell's light, root mean square over the strongest cells, that is a press."""
STRONGEST = 12
APART_S = 0.5
"""A press counts as another one if the gel was free for so long before it."""


class HealthWatch:
    """Follows the health of live frames, one after the other."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._last: dict[str, tuple[float, Finding]] = {}
        self._recovery = Recovery()

    def update(self, health: Health, time_s: float) -> Health:
        """Add the health of a frame; return persistent faults.

        Parameters
        ----------
        health : Health
            Of the newest frame.
        time_s : float
            When it was taken.
        """
        findings = list(health.findings)
        left = None if health.faults else self._recovery.update(health.cells, time_s)
        if left is not None:
            findings.append(not_recovered(left))
        for finding in findings:
            before = self._last.get(finding.key)
            if before is None or not 0.0 <= time_s - before[0] <= HOLD_S:
                self._since[finding.key] = time_s
            self._last[finding.key] = time_s, finding
        lasting = [
            finding
            for key, (seen, finding) in self._last.items()
            if 0.0 <= time_s - seen <= (HOLD_S if self._lasted(key) else 0.0) and self._lasted(key)
        ]
        return health_of(lasting, unknown=health.unknown, untouched=health.untouched)

    @property
    def presses(self) -> int:
        """Number of presses seen so far."""
        return self._recovery.presses

    def _lasted(self, key: str) -> bool:
        return self._last[key][0] - self._since[key] >= LASTING_S


class Recovery:
    """Looks for what is left of the last press after it was released.

    Attributes
    ----------
    presses : int
        Number of presses seen so far. One that was there from the start is not among them.
    """

    def __init__(self) -> None:
        self.presses = 0
        self._was_free = self._recovered = False
        self._pattern: Array | None = None
        self._size = 0.0
        self._pressed_s = 0.0
        self._left: deque[tuple[float, float]] = deque()

    def update(self, cells: Array | None, time_s: float) -> float | None:
        """Add a frame; return the remaining share of the last press, None if there is none.

        Parameters
        ----------
        cells : (cells, 3) or None
            Change of the light of each cell; None where it is not known.
        time_s : float
            When it was taken.
        """
        if cells is None:
            return None
        if self._pattern is not None and not 0.0 <= time_s - self._pressed_s <= REMEMBERED_S:
            self._pattern = None
        size = _size(cells)
        if size > LEAST_CHANGE and (self._pattern is None or size > PRESSED * self._size):
            self._count(time_s)
            if self._pattern is None or self._left or size > self._size:
                self._pattern, self._size = cells.copy(), size
            self._pressed_s = time_s
            self._left.clear()
            return None
        self._was_free = True
        if self._pattern is None:
            return None
        square = float((self._pattern**2).sum())
        self._left.append((time_s, float((cells * self._pattern).sum()) / square))
        while self._left and time_s - self._left[0][0] > 2.0 * FALLS_S:
            self._left.popleft()
        now = self._left[-1][1]
        if now < RECOVERED:
            self._recovered = True
            return None
        first_s, first = self._left[0]
        return now if time_s - first_s >= FALLS_S and now < FALLS * first else None

    def _count(self, time_s: float) -> None:
        """Add a pressed frame; count the press if it is a new one."""
        apart = bool(self._left) and time_s - self._pressed_s >= APART_S
        if self._was_free and (self._pattern is None or self._recovered or apart):
            self.presses += 1
            self._recovered = False
        self._was_free = False


def _size(cells: Array) -> float:
    change = np.sort((cells**2).mean(axis=1))[-STRONGEST:]
    return float(np.sqrt(change.mean())) if change.size else 0.0


def not_recovered(left: float) -> Finding:
    """Return that a share of the last press is still seen."""
    return Finding(
        "not_recovered",
        tr("the gel has not recovered: {p:.1f} % of the last press remains").format(p=100.0 * left),
        100.0 * left,
        "%",
        verdict=Verdict.WARN,
        remedy=tr("Wait before the next press, and press for less time"),
        heights=Heights.DOUBTFUL,
    )
