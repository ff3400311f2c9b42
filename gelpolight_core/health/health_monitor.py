"""The health of a live sensor: persistent faults, and a gel that has not recovered yet."""

from __future__ import annotations

import math

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.finding import Finding
from gelpolight_core.image.change_detection import (
    CONTACT_CHANGE,
    LASTS_S,
    PRESSED_SHARE,
    changed_mask,
    straight_line,
)
from gelpolight_core.image.scaled_difference import REPEATABILITY

from .faults import health_of, make_fault
from .frame_health import FrameHealth

HOLD_S = 3.0
"""A fault is shown until it was not seen for so long: a stripe of rows comes back after seconds."""


class HealthMonitor:
    """Follows the health of live frames, one after the other."""

    def __init__(self) -> None:
        self._seen: dict[str, tuple[float, float, Finding]] = {}
        self._recovery = RecoveryMonitor()

    def update(self, health: FrameHealth, time_s: float) -> FrameHealth:
        """Add the health of a frame, and return the persistent faults.

        Parameters
        ----------
        health : FrameHealth
            Health of the newest frame.
        time_s : float
            When it was taken.
        """
        findings = list(health.findings)
        remaining_share = None if health.faults else self._recovery.update(health.cells, time_s)
        if remaining_share is not None:
            findings.append(make_fault("not_recovered", 100.0 * remaining_share))
        self._seen = {
            key: record for key, record in self._seen.items() if 0.0 <= time_s - record[1] <= HOLD_S
        }
        for finding in findings:
            first_s = self._seen.get(finding.key, (time_s,))[0]
            self._seen[finding.key] = first_s, time_s, finding
        lasting = [f for first_s, last_s, f in self._seen.values() if last_s - first_s >= LASTS_S]
        return health_of(lasting, unknown=health.unknown, untouched=health.untouched)


class RecoveryMonitor:
    """Looks for what is left of the last press after it was released.

    A press is more than half as strong as the strongest frame of the last one, or has doubled since
    then; what is left of a press falls until it is gone.
    """

    def __init__(self) -> None:
        self._strongest, self._press = 0.0, np.zeros(())
        self._limit = CONTACT_CHANGE
        self._left: list[tuple[float, float]] = []
        self._recovers = False

    def update(self, cells: Float64Array | None, time_s: float) -> float | None:
        """Add a frame. Return the remaining share of the last press, or None.

        Parameters
        ----------
        cells : (cells, 3) or None
            Change of the light of each cell; None where it is not known.
        time_s : float
            When it was taken.
        """
        if cells is None or not cells.size:
            return None
        size = float(np.quantile(np.abs(cells).max(axis=1), 1.0 - PRESSED_SHARE))
        if size > self._limit:
            if self._left or size > self._strongest:
                self._strongest, self._press = size, cells.copy()
            self._limit = max(CONTACT_CHANGE, 0.5 * self._strongest)
            self._left, self._recovers = [], False
            return None
        self._limit = max(CONTACT_CHANGE, min(self._limit, 2.0 * size))
        square = float((self._press**2).sum())
        share = float((cells * self._press).sum()) / square if square else 0.0
        self._left = [x for x in self._left if 0.0 <= time_s - x[0] <= HOLD_S]
        self._left.append((time_s, share))
        shares = np.array(self._left)
        change = _change(shares)
        remains = shares[:, 1].mean() > REPEATABILITY
        self._recovers = remains and (change < 0.0 or (self._recovers and not change))
        return share if self._recovers and share > REPEATABILITY else None


def _change(left: Float64Array) -> float:
    """Return the change of the remaining share of a press, 0 within noise."""
    times_s, share = left.T
    if len(left) < 3 or np.ptp(times_s) < 2.0 * LASTS_S:
        return 0.0
    change, scatter = straight_line(share, times_s)
    sd = float(scatter) * math.sqrt(12.0 / len(left))
    held = changed_mask(share.mean() - change, share.mean(), sd, CONTACT_CHANGE)
    return float(change) if held else 0.0
