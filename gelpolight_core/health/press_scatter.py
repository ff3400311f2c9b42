"""Change of the light by healthy presses.

The images of the calibration's own balls show by how much; only what exceeds it is a change of the
sensor. A press changes the light of a closed sensor by some percent everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import stdtrit

from gelpolight_core.base.arrays import Float64Array

from .change_fit import ROWS
from .fault_limits import SIGMAS
from .global_change import GlobalChange
from .health_samples import BLUR, PARAMETERS, SHIFT_U, SHIFT_V

FALSE_ALARMS = 1e-3
"""Tolerated share of healthy images in which a change is stated."""
EXPLAINED = ("room_light", "uneven", "colour_mixing", "tone", "camera_moved", "blurred", ROWS)
"""In the order of calibration files."""
COMMON = PARAMETERS + 3
"""Kinds of common change: all parameters, and the gains without room light."""
KINDS = COMMON + len(EXPLAINED)
"""Kinds of change: the common ones, and the evidence for each explanation."""
OLDER_KINDS = COMMON + 1
"""Of older files, whose last kind is not used any more."""
PRESS = 0.0006
"""Standard deviation of the light around presses of an open sensor without interreflection; with
it, more light comes back."""


def changes_of(common: GlobalChange, evidence: Mapping[str, float]) -> Float64Array:
    """Return the changes (KINDS,) that the fits to a frame have found."""
    explained = [evidence.get(key, 0.0) for key in EXPLAINED]
    return np.concatenate([common.values, common.gain, explained])


@dataclass(frozen=True, slots=True)
class HealthyPressScatter:
    """The scatter of healthy presses.

    Attributes
    ----------
    mean, sd : (COMMON,)
        Mean and standard deviation of their common changes.
    evidence : mapping
        Evidence for explanations that they reach; 0 for those that are not in it.
    corrected : bool
        Whether the light of every press is corrected, as that of the calibration's presses was.
    """

    mean: Float64Array
    sd: Float64Array
    evidence: Mapping[str, float] = field(default_factory=dict)
    corrected: bool = False

    def common(self, found: GlobalChange) -> GlobalChange:
        """Return a common change as its difference from the usual one, with its scatter.

        Gains are those without room light, unless there is more than usual.
        """
        every, alone = slice(0, PARAMETERS), slice(PARAMETERS, COMMON)
        values, sd = found.values - self.mean[every], np.hypot(found.sd, self.sd[every])
        gain, gain_sd = found.gain - self.mean[alone], np.hypot(found.gain_sd, self.sd[alone])
        if (np.abs(values[1:6:2]) < SIGMAS * sd[1:6:2]).all():
            values[1:6:2] = 0.0
            values[:6:2], sd[:6:2] = gain, gain_sd
        return replace(found, values=values, sd=sd, gain=gain, gain_sd=gain_sd)


ANY_LIGHT = HealthyPressScatter(
    np.zeros(COMMON), np.full(COMMON, np.inf), dict.fromkeys(EXPLAINED, np.inf), corrected=True
)
"""Where nothing is known of the presses: every change may be healthy."""


def closed_press_scatter(seen: Float64Array | None) -> HealthyPressScatter:
    """Return the scatter of some presses of a closed sensor.

    Parameters
    ----------
    seen : (presses, KINDS) float64 or None
        Result of :func:`changes_of` for each, if it is known.
    """
    if seen is None or len(seen) < 2:
        return ANY_LIGHT
    count = len(seen)
    # Of a normal value that few others predict: Student's distribution.
    far = stdtrit(count - 1, 1.0 - FALSE_ALARMS / (2 * KINDS)) * np.sqrt(1.0 + 1.0 / count)
    mean, sd = seen.mean(axis=0), seen.std(axis=0, ddof=1)
    reached = (
        (mean + far * sd)[COMMON:] if seen.shape[1] == KINDS else np.full(len(EXPLAINED), np.inf)
    )
    evidence = dict(zip(EXPLAINED, reached.tolist(), strict=True))
    common = np.s_[:COMMON]
    return HealthyPressScatter(mean[common], far / SIGMAS * sd[common], evidence, corrected=True)


def open_press_scatter(interreflection: float = 0.0) -> HealthyPressScatter:
    """Return the scatter of presses of an open sensor, which the model of its light explains.

    Parameters
    ----------
    interreflection : float, optional
        Reflectance of its membrane for interreflected light.
    """
    of_light = np.full(COMMON, PRESS * (1.0 + interreflection))
    of_light[[1, 3, 5, SHIFT_U, SHIFT_V, BLUR]] = 0.0
    return HealthyPressScatter(np.zeros(COMMON), of_light)
