"""Derive faults from the fit of a frame.

A change is stated where it is larger than its standard deviation explains and costs more than a
percent of the heights; where it costs a fifth of them, they mean nothing.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gelpolight_core.arrays import Array
from gelpolight_core.bad_pixels import FAR_SHARE
from gelpolight_core.channels import CHANNEL_KEYS
from gelpolight_core.finding import Finding, Heights, Verdict
from gelpolight_core.light.finding import LightGain
from gelpolight_core.light.fit import LEAST_START, CommonChange, Uneven
from gelpolight_core.light.movement import FOLLOWED_PX
from gelpolight_core.light.samples import BLUR, BLURS_PX, SHIFT_U, SHIFT_V, Samples

if TYPE_CHECKING:
    from collections.abc import Sequence

SIGMAS, CLEAR = 3.0, 2.0
"""Standard deviations from which on a change is stated, and up to which it may explain an error."""
GAIN, OFFSET, SHIFT_PX, BLUR_PX = 0.0022, 0.0003, 0.6, 1.4
"""Changes that make a press of 1 mm wrong by 1 %: of all light, of room light as a share of full
scale, of the camera's place, of the sharpness."""
ALONE = 2.0
"""Of a single channel, more is needed by this factor."""
FAR = 20.0
"""Percent of the heights from which on an error makes them meaningless; it grows with the square of
a blur. A gain of any size is corrected."""
ROUNDING = 0.125
"""Means of four pixels that are rounded to whole numbers, as in images of half the size, are too
large by an eighth of a step."""
CORRECTABLE = ("exposure", "led_weak", "uneven")
DARK = 0.2
"""Share of the light at calibration below which an LED is off."""
SATURATED_SHARE, SATURATED_CONTACT, MOSTLY_SATURATED = 0.01, 0.05, 0.3
"""Of the field, and of its part that has changed: a shiny membrane saturates in a contact, and
less than a twentieth of it that is left out costs little."""
DIRT_CHANGE, DIRT_SPREAD, DIRT_RUNS = -0.06, 0.12, 2
"""Dirt darkens the channels alike; a slope does not."""
BAD_SHARE, LEAST_BAD = 1e-4, 3
_AGAIN = "set to zero or capture the background again"
_NEW_CAMERA = "Calibrate again, so that they are left out, or replace the camera"
FAULTS = {
    "dark": (
        "the image is dark: the LEDs are off, or the lens is covered",
        "Switch the LEDs on and uncover the lens",
        "",
    ),
    "all_pressed": (
        (
            "nearly everything is pressed: too little untouched membrane is left to compare with, "
            "and all heights may be wrong by one constant"
        ),
        "Press so that a part of the field stays free, also at its boundary",
        "",
    ),
    "compressed": (
        "fine detail of the image is lost: it was compressed, resized or filtered",
        (
            "Use the camera's images as at calibration: PNG or TIFF, without noise reduction or "
            "other processing"
        ),
        "",
    ),
    "led_off": (
        "the {name} LED is off",
        "Check its cable and driver, then calibrate again",
        "%",
    ),
    "led_weak": (
        "the {name} LED is {n:.1f} % {how} than at calibration",
        "Let the LEDs warm up and check their current; then {again}",
        "%",
    ),
    "exposure": (
        "the light is {n:.1f} % {how} than at calibration: exposure, gain or LEDs changed",
        "Restore the camera settings of the calibration, or {again}",
        "%",
    ),
    "uneven": (
        "parts of the image are up to {n:.1f} % {how} than at calibration",
        "Clean the lens and check that nothing shades it; then {again}",
        "%",
    ),
    "room_light": (
        "there is {n:.2f} % of full scale {more} room light than at calibration",
        "Shade the sensor as at calibration, and check the camera's black level",
        "%",
    ),
    "camera_moved": (
        "the camera has moved against the membrane by {n:.1f} px{beyond}",
        "Seat the camera and the elastomer as at calibration, or calibrate again",
        "px",
    ),
    "blurred": (
        "the image is blurred by {n:.1f} px more than at calibration",
        "Focus the lens and clean it; calibrate again if the focus was changed",
        "px",
    ),
    "dirt": (
        "something dark lies on the membrane, the window or the lens",
        "Clean the sensor and the lens",
        "mm2",
    ),
    "saturated": (
        "{n:.0f} % of the membrane is saturated",
        "Restore the exposure of the calibration, and shade the sensor",
        "%",
    ),
    "bad_line": ("the camera has a dead or hot {kind} at {places}", _NEW_CAMERA, ""),
    "bad_pixels": ("{n:.2g} % of the pixels are dead or hot", _NEW_CAMERA, "%"),
    "colour_order": (
        "the colours come in the order {letters} instead of RGB",
        "Set the camera's colour order as at calibration",
        "",
    ),
    "other_sensor": (
        (
            "nothing in the image looks like this sensor's untouched membrane: it is another "
            "sensor, or nearly everything is pressed"
        ),
        (
            "Use the calibration of the sensor that captured the image; if it is the "
            "right one, press less of the field, and seat camera and elastomer"
        ),
        "",
    ),
}
"""Text, remedy and unit of each fault; `n` is its size without its sign."""


def fault(key: str, value: float = math.nan, *, far: bool = False, **facts: object) -> Finding:
    """Return a finding of `FAULTS`; one that is `far` makes the depth meaningless.

    Parameters
    ----------
    key : str
        Of the fault.
    value : float, optional
        Its size, in its unit.
    far : bool, optional
        Whether the depth means nothing.
    **facts
        Other words of the text.
    """
    text, remedy, unit = FAULTS[key]
    how = "brighter" if value > 0.0 else "darker"
    more = "more" if value > 0.0 else "less"
    return Finding(
        key,
        text.format(n=abs(value), how=how, more=more, **facts),
        value,
        unit,
        verdict=Verdict.FAIL if far else Verdict.WARN,
        remedy=remedy.format(again=_AGAIN),
        heights=Heights.MEANINGLESS if far else Heights.DOUBTFUL,
    )


def may_have_moved(common: CommonChange) -> bool:
    """Return whether the camera may have moved by more than the fit can follow."""
    large = math.hypot(common.values[SHIFT_U], common.values[SHIFT_V]) > 1.0
    return bool(large or common.values[BLUR] > 1.0)


def light_findings(common: CommonChange, step: float) -> list[Finding]:
    """Return changes of the LEDs, the exposure and the room's light.

    `common` is the difference from healthy presses, and `step` the share of full scale from one
    number of the image to the next.
    """
    found = []
    gains, offsets = common.values[:6:2], common.values[1:6:2]
    gain_sd, offset_sd = common.sd[:6:2], common.sd[1:6:2]
    # A shallow wide face in much noise looks like a gain and room light that cancel each other.
    clear = abs(float(common.gain.mean())) > SIGMAS * float(common.gain_sd.max())
    mean, middle = float(gains.mean()), float(np.median(gains))
    k = int(np.argmax(np.abs(gains - middle)))
    change, apart = float(gains[k]), abs(float(gains[k]) - middle)
    if apart > max(SIGMAS * float(gain_sd[k]), ALONE * GAIN):
        if change < DARK - 1.0:
            found.append(_led_off(k, change))
        else:
            found.append(fault("led_weak", 100.0 * change, name=CHANNEL_KEYS[k]))
    elif clear and abs(mean) > max(SIGMAS * float(gain_sd.max()), GAIN):
        found.append(fault("exposure", 100.0 * mean))
    k = int(np.argmax(np.abs(offsets)))
    offset, least = float(offsets[k]), max(OFFSET, ROUNDING * step)
    of_all = least + SIGMAS * float(offset_sd.max()) / math.sqrt(3.0)
    of_one = ALONE * least + SIGMAS * float(offset_sd[k])
    size = max(abs(float(offsets.mean())) / of_all, abs(offset) / of_one)
    if size > (1.0 if clear else SIGMAS):
        found.append(fault("room_light", 100.0 * offset, far=abs(offset) > FAR * OFFSET))
    return found


def light_gain(common: CommonChange, changes: Sequence[Finding]) -> LightGain | None:
    """Return the correction of the light; None if the light is the same, or too different.

    Parameters
    ----------
    common : CommonChange
        The difference from healthy presses.
    changes : sequence of Finding
        From :func:`light_findings`. An LED that is off has no light to correct.
    """
    if any(found.meaningless for found in changes):
        return None
    gain, sd = common.gain, common.gain_sd
    if any(found.key not in CORRECTABLE for found in changes):
        # With room light, which remains a fault, the gain is that of the joint fit.
        gain, sd = common.values[:6:2], common.sd[:6:2]
    stated = any(found.key in CORRECTABLE for found in changes)
    small = not changes and bool((np.abs(gain) > SIGMAS * sd).any())
    return LightGain(1.0 + gain, sd) if stated or small else None


def with_shape(gain: LightGain | None, common: CommonChange, uneven: Uneven) -> LightGain:
    """Return a correction of the light, if there is one, with that of its distribution."""
    gain = gain or LightGain(np.ones(3), common.gain_sd)
    return replace(gain, sd=np.hypot(gain.sd, uneven.sd), shape=uneven.shape)


def corrected(change: Finding) -> Finding:
    """Return the finding of a change of the light that is corrected; room light is not.

    A large uneven change need not have the shapes that were fitted.
    """
    if change.key not in CORRECTABLE or (change.key == "uneven" and change.meaningless):
        return change
    remedy = f"The depth is corrected for this. {change.remedy}"
    return replace(change, remedy=remedy, verdict=Verdict.WARN, heights=Heights.STATED)


def uneven_finding(uneven: Uneven | None) -> Finding | None:
    """Return that the light has another distribution over the image; None where it has not."""
    if uneven is None or abs(uneven.largest) < max(SIGMAS * uneven.sd, GAIN):
        return None
    far = abs(uneven.largest) > FAR * GAIN
    return fault("uneven", 100.0 * uneven.largest, far=far)


def led_off_findings(light: Array) -> list[Finding]:
    """Return the LEDs that are off, where crosstalk changes the pattern of all channels.

    Parameters
    ----------
    light : (3,)
        All light of each channel over that at calibration.
    """
    off = light < DARK
    if off.all():
        return [fault("dark", far=True)]
    return [_led_off(int(k), float(light[k]) - 1.0) for k in np.flatnonzero(off)]


def _led_off(k: int, change: float) -> Finding:
    return fault("led_off", 100.0 * change, far=True, name=CHANNEL_KEYS[k])


def moved_finding(common: CommonChange, seen_px: tuple[float, float] | None) -> Finding | None:
    """Return that the camera has moved.

    Parameters
    ----------
    common : CommonChange
        The fit, which follows a pixel or two.
    seen_px : (float, float) or None
        Result of a search, if there was one.
    """
    if seen_px is not None and math.hypot(*seen_px) > SHIFT_PX:
        return far_moved_finding(seen_px)
    size = math.hypot(common.values[SHIFT_U], common.values[SHIFT_V])
    if size < max(SIGMAS * math.hypot(common.sd[SHIFT_U], common.sd[SHIFT_V]), SHIFT_PX):
        return None
    lost = size > FOLLOWED_PX  # the fit cannot follow so far
    beyond = " or more" if lost else ""
    return fault("camera_moved", size, far=common.share < LEAST_START and lost, beyond=beyond)


def far_moved_finding(shift_px: tuple[float, float]) -> Finding:
    """Return that the camera has moved, by a search."""
    size = math.hypot(*shift_px)
    return fault("camera_moved", size, far=size > FAR * SHIFT_PX, beyond="")


def blur_finding(common: CommonChange, strength: Array) -> Finding | None:
    """Return that the image is blurred; None if it is not, or if there is no texture."""
    if not strength.size or common.values[BLUR] < SIGMAS * common.sd[BLUR]:
        return None
    size = float(np.interp(common.values[BLUR], strength, (0.0, *BLURS_PX)))
    cost = (size / BLUR_PX) ** 2
    return fault("blurred", size, far=cost > FAR) if cost > 1.0 else None


def saturated_finding(share: float, changed: float = 1.0) -> Finding | None:
    """Return that much of the field is saturated, and of its `changed` share."""
    if share < max(SATURATED_SHARE, SATURATED_CONTACT * changed):
        return None
    return fault("saturated", 100.0 * share, far=share > MOSTLY_SATURATED)


def dirt_finding(
    samples: Samples, run_change: Array, common: CommonChange, unmix: Array
) -> Finding | None:
    """Return that something dark is on the membrane or in the path of the light.

    Channels that show the light of one LED alone, by crosstalk, are alike on a slope, too: `unmix`
    (3, 3) gives the light of each LED, and only runs that all of them light are judged.
    """
    led_light = unmix @ samples.run_light
    lit = (led_light > 0.5 * samples.run_light).all(axis=0)
    changes = unmix @ run_change / np.where(lit, led_light, 1.0)
    red, green, blue = (changes[k] - common.values[2 * k] for k in range(3))
    most = np.maximum(np.maximum(red, green), blue)
    least = np.minimum(np.minimum(red, green), blue)
    dark = (most < DIRT_CHANGE) & (most - least < -DIRT_SPREAD * most)
    if not dark.any():
        return None
    dark &= lit & ~common.untouched[samples.run_cell]
    runs = np.bincount(samples.run_cell[dark], minlength=samples.count.size)
    around = runs + runs[samples.beside].sum(axis=1)
    if around.max() < DIRT_RUNS:
        return None
    return fault("dirt", float(np.count_nonzero(runs)))


def bad_pixel_findings(
    share: float, count: int, columns: Sequence[int], rows: Sequence[int]
) -> list[Finding]:
    """Return lines and single pixels that do not follow the light."""
    found = []
    for kind, places in (("column", columns), ("row", rows)):
        if places:
            names = ", ".join(str(n) for n in places[:5])
            line = fault("bad_line", float(len(places)), kind=kind, places=names)
            found.append(replace(line, verdict=Verdict.FAIL))
    if share > BAD_SHARE and count >= LEAST_BAD:
        found.append(fault("bad_pixels", 100.0 * share, far=share > FAR_SHARE))
    return found
