"""How much the light of healthy presses differs from that of the untouched membrane.

A press changes the light of a closed sensor by some percent everywhere. The images of the
calibration's own balls show by how much; only what exceeds it is a change of the sensor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from gelpolight_core.light.fit import CommonChange, Uneven
from gelpolight_core.light.judging import SIGMAS
from gelpolight_core.light.samples import PARAMETERS

Array = NDArray[np.float64]
FALSE_ALARMS = 1e-3
"""Tolerated share of healthy images in which a change is stated."""
KINDS = PARAMETERS + 4
"""Kinds of change: all parameters, the gains without room light, and the uneven change."""


def changes_of(common: CommonChange, uneven: Uneven | None) -> Array:
    """Return the changes (KINDS,) that the fit to a frame has found."""
    largest = 0.0 if uneven is None else uneven.largest
    return np.concatenate([common.values, common.gain, [largest]])


class Usual:
    """The scatter of healthy presses.

    Parameters
    ----------
    seen : (presses, KINDS) float64 or None
        Result of :func:`changes_of` for each; None: any change may be healthy.
    """

    def __init__(self, seen: Array | None) -> None:
        self._mean, self._sd = np.zeros(KINDS), np.full(KINDS, np.inf)
        if seen is None:
            return
        count = len(seen)
        # Of a normal value that few others predict: Student's distribution.
        far = stdtrit(count - 1, 1.0 - FALSE_ALARMS / (2 * KINDS)) / SIGMAS
        self._mean = seen.mean(axis=0)
        self._sd = far * np.sqrt(1.0 + 1.0 / count) * seen.std(axis=0, ddof=1)

    def common(self, found: CommonChange) -> CommonChange:
        """Return a common change as its difference from the usual one, with its scatter.

        Gains are those without room light, unless there is more than usual.
        """
        every, alone = slice(0, PARAMETERS), slice(PARAMETERS, KINDS - 1)
        values, sd = found.values - self._mean[every], np.hypot(found.sd, self._sd[every])
        gain_sd = np.hypot(found.gain_sd, self._sd[alone])
        if (np.abs(values[1:6:2]) < SIGMAS * sd[1:6:2]).all():
            values[1:6:2] = 0.0
            values[:6:2], sd[:6:2] = found.gain - self._mean[alone], gain_sd
        return replace(found, values=values, sd=sd, gain_sd=gain_sd)

    def uneven(self, found: Uneven | None) -> Uneven | None:
        """Return an uneven change as its difference from the usual one, with its scatter."""
        if found is None:
            return None
        sd = float(np.hypot(found.sd, self._sd[-1]))
        return replace(found, largest=found.largest - float(self._mean[-1]), sd=sd)
