"""Derive faults from the fit of a frame; the limits keep the error of the depth at 10 um."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.bad_pixels import FAR_SHARE
from gelpolight_core.channels import channel_name
from gelpolight_core.finding import Finding, Heights, Verdict
from gelpolight_core.light.finding import LightGain
from gelpolight_core.light.fit import LEAST_START, CommonChange, Uneven
from gelpolight_core.light.movement import FOLLOWED_PX
from gelpolight_core.light.samples import BLUR, BLURS_PX, SHIFT_U, SHIFT_V, Samples
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = NDArray[np.float64]
SIGMAS, CLEAR = 3.0, 2.0
"""Standard deviations from which on a change is stated, and from which on it is corrected."""
PRESS, PRESS_BY_INTERREFLECTION = 0.001, 0.0015
"""Standard deviation of the change of a channel that presses cause in the untouched membrane, and
its part over the membrane's interreflection. 10 um of a press 1 mm deep are the cost of a change by
0.5 %, and of one of all channels by 0.22 %."""
LEAST_OFFSET, LEAST_LOSS, ROUNDING = 0.0002, 0.0006, 0.125
"""More and less room light than at calibration, share of full scale; 0.0003 costs 10 um. A shallow
press over much of the field looks like a loss of up to 0.0005. Means of four pixels that are
rounded to whole numbers, as in images of half the size, are too large by an eighth of a step."""
CORRECTABLE = ("exposure", "led_weak", "uneven")
LEAST_SHIFT_PX = 0.5
"""0.6 px cost 10 um."""
LEAST_BLUR_PX = 1.0
"""A blur of 1.4 px costs 10 um."""
LED_OFF, LEAST_LIT = -0.8, -0.5
"""Change of a channel below which its LED is off, and above which the others are on."""
FAR_UNEVEN, FAR_OFFSET = 0.05, 0.005
"""Above these, the error of the depth is a third of its value or more: such a change need not have
the shapes that are fitted. A gain of any size is corrected to a few hundredths of a percent."""
FAR_SHIFT_PX, FAR_BLUR_PX = 10.0, 6.0
SATURATED_SHARE, SATURATED_CONTACT, MOSTLY_SATURATED = 0.01, 0.05, 0.3
"""Of the field, and of its part that has changed: a shiny membrane saturates in a contact, and
less than a twentieth of it that is left out costs little."""
DIRT_CHANGE, DIRT_SPREAD, DIRT_RUNS = -0.06, 0.12, 2
"""Dirt darkens the channels alike; a slope does not."""
BAD_SHARE, LEAST_BAD = 1e-4, 3
BACKGROUND = tr("set to zero or capture the background again")


def may_have_moved(common: CommonChange) -> bool:
    """Return whether the camera may have moved by more than the fit can follow."""
    large = math.hypot(common.values[SHIFT_U], common.values[SHIFT_V]) > 1.0
    return bool(large or common.values[BLUR] > 1.0)


def light_findings(common: CommonChange, press_sd: float, step: float) -> list[Finding]:
    """Return changes of the LEDs, the exposure and the room's light.

    `press_sd` is the standard deviation of what a press changes in a channel around it, `step` the
    share of full scale from one number of the image to the next.
    """
    found = []
    gains, gain_sd = common.values[:6:2], common.sd[:6:2]
    offsets, offset_sd = common.values[1:6:2], common.sd[1:6:2]
    # A shallow wide face in much noise looks like a gain and room light that cancel each other.
    net, net_sd = abs(float(common.gain.mean())), float(common.gain_sd.max()) / math.sqrt(3.0)
    single = _led_finding(gains, press_sd + gain_sd)
    if single is not None:
        found.append(single)
    else:
        mean, sd = float(gains.mean()), float(gain_sd.max()) / math.sqrt(3.0)
        of_press = press_sd / math.sqrt(3.0)
        if abs(mean) > SIGMAS * (of_press + sd) and net > SIGMAS * (of_press + net_sd):
            found.append(_exposure_finding(mean))
    worst = int(np.argmax(np.abs(offsets)))
    mean = float(offsets.mean())
    least, least_of_one = (
        max(LEAST_OFFSET if offset > 0.0 else LEAST_LOSS, ROUNDING * step)
        for offset in (mean, offsets[worst])
    )
    common_size = least + SIGMAS * float(offset_sd.max()) / math.sqrt(3.0)
    own_size = 2.0 * least_of_one + SIGMAS * float(offset_sd[worst])
    size = max(abs(mean) / common_size, float(abs(offsets[worst])) / own_size)
    if size > (1.0 if net > SIGMAS * net_sd else SIGMAS):
        found.append(_room_finding(float(offsets[worst])))
    return found


def light_gain(
    common: CommonChange, changes: Sequence[Finding], press_sd: float
) -> LightGain | None:
    """Return the correction of the light; None if the light is the same, or too different.

    Parameters
    ----------
    common : CommonChange
        The fit to the untouched membrane.
    changes : sequence of Finding
        From :func:`light_findings`. An LED that is off has no light to correct.
    press_sd : float
        Standard deviation of what a press changes in a channel around it.
    """
    if any(found.meaningless for found in changes):
        return None
    gain, sd = common.gain, common.gain_sd
    if any(found.key not in CORRECTABLE for found in changes):
        if not any(found.key in CORRECTABLE for found in changes):
            return None
        # With room light, which remains a fault, the gain is that of the joint fit.
        gain, sd = common.values[:6:2], common.sd[:6:2]
    mean, of_mean = abs(float(gain.mean())), math.sqrt(1.0 / 3.0)
    sure = (np.abs(gain) > CLEAR * press_sd + SIGMAS * sd).any()
    if not sure and mean < of_mean * (CLEAR * press_sd + SIGMAS * float(sd.max())):
        return None
    return LightGain(1.0 + gain, np.hypot(sd, press_sd))


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
    remedy = tr("The depth is corrected for this. {remedy}").format(remedy=change.remedy)
    return replace(change, remedy=remedy, verdict=Verdict.WARN, heights=Heights.STATED)


def uneven_finding(uneven: Uneven | None, press_sd: float) -> Finding | None:
    """Return that the light has another distribution over the image; None where it has not."""
    if uneven is None or abs(uneven.largest) < SIGMAS * (press_sd + uneven.sd):
        return None
    text = tr("parts of the image are up to {p:.1f} % {how} than at calibration")
    text = text.format(
        p=100.0 * abs(uneven.largest), how=tr("darker") if uneven.largest < 0.0 else tr("brighter")
    )
    remedy = tr("Clean the lens and check that nothing shades it; then {again}")
    far = abs(uneven.largest) > FAR_UNEVEN
    largest = 100.0 * uneven.largest
    return _graded("uneven", text, remedy.format(again=BACKGROUND), far, largest, "%")


def _led_finding(gains: Array, sd: Array) -> Finding | None:
    """Return the LED whose channel has changed differently from the others, or None."""
    middle = float(np.median(gains))
    k = int(np.argmax(np.abs(gains - middle)))
    change = float(gains[k])
    if abs(change - middle) < SIGMAS * float(sd[k]):
        return None
    if change < LED_OFF:
        return _led_off_finding(k, change)
    text = tr("the {name} LED is {p:.1f} % {how} than at calibration").format(
        name=channel_name(k),
        p=100.0 * abs(change),
        how=tr("weaker") if change < 0.0 else tr("brighter"),
    )
    remedy = tr("Let the LEDs warm up and check their current; then {again}")
    return _graded("led_weak", text, remedy.format(again=BACKGROUND), False, 100.0 * change, "%")


def led_off_findings(change: Array) -> list[Finding]:
    """Return the LEDs that are off, where crosstalk changes the pattern of all channels.

    Parameters
    ----------
    change : (3,)
        Change of all light of each channel over that at calibration; -1 is no light.
    """
    off = change < LED_OFF
    lit = change > LEAST_LIT
    if not off.any() or not (off | lit).all():
        return []
    return [_led_off_finding(int(k), float(change[k])) for k in np.flatnonzero(off)]


def _led_off_finding(k: int, change: float) -> Finding:
    text = tr("the {name} LED is off").format(name=channel_name(k))
    remedy = tr("Check its cable and driver, then calibrate again")
    return _graded("led_off", text, remedy, True, 100.0 * change, "%")


def _exposure_finding(change: float) -> Finding:
    text = tr("the light is {p:.1f} % {how} than at calibration: exposure, gain or LEDs changed")
    text = text.format(p=100.0 * abs(change), how=tr("brighter") if change > 0.0 else tr("darker"))
    remedy = tr("Restore the camera settings of the calibration, or {again}")
    return _graded("exposure", text, remedy.format(again=BACKGROUND), False, 100.0 * change, "%")


def _room_finding(offset: float) -> Finding:
    text = tr("room light reaches the membrane ({p:.2f} % of full scale)")
    if offset < 0.0:
        text = tr("there is less room light than at calibration ({p:.2f} % of full scale)")
    text = text.format(p=100.0 * abs(offset))
    remedy = tr("Shade the sensor as at calibration, and check the camera's black level")
    return _graded("room_light", text, remedy, abs(offset) > FAR_OFFSET, 100.0 * offset, "%")


def moved_finding(common: CommonChange, seen_px: tuple[float, float] | None) -> Finding | None:
    """Return that the camera has moved.

    Parameters
    ----------
    common : CommonChange
        The fit, which follows a pixel or two.
    seen_px : (float, float) or None
        Result of a search, if there was one.
    """
    if seen_px is not None and math.hypot(*seen_px) > LEAST_SHIFT_PX:
        return far_moved_finding(seen_px)
    shift = (float(common.values[SHIFT_U]), float(common.values[SHIFT_V]))
    sd = float(np.hypot(common.sd[SHIFT_U], common.sd[SHIFT_V]))
    size = math.hypot(*shift)
    if size <= LEAST_SHIFT_PX + SIGMAS * sd:
        return None
    text = tr("the camera has moved against the membrane by {n:.1f} px")
    if size > FOLLOWED_PX:
        text = tr("the camera has moved against the membrane by {n:.1f} px or more")
    far = common.share < LEAST_START and size > FOLLOWED_PX
    return _moved(text.format(n=size), size, far)


def far_moved_finding(shift_px: tuple[float, float]) -> Finding:
    """Return that the camera has moved, by a search."""
    size = math.hypot(*shift_px)
    text = tr("the camera has moved against the membrane by {n:.1f} px")
    return _moved(text.format(n=size), size, size > FAR_SHIFT_PX)


def _moved(text: str, size: float, far: bool) -> Finding:
    remedy = tr("Seat the camera and the elastomer as at calibration, or calibrate again")
    return _graded("camera_moved", text, remedy, far, size, "px")


def blur_finding(common: CommonChange, strength: Array) -> Finding | None:
    """Return that the image is blurred; None if it is not, or if there is no texture."""
    if not strength.size:
        return None
    seen, sd = float(common.values[BLUR]), float(common.sd[BLUR])
    sizes = (0.0, *BLURS_PX)
    if seen < float(np.interp(LEAST_BLUR_PX, sizes, strength)) + SIGMAS * sd:
        return None
    size = float(np.interp(seen, strength, sizes))
    text = tr("the image is blurred by {n:.1f} px more than at calibration").format(n=size)
    remedy = tr("Focus the lens and clean it; calibrate again if the focus was changed")
    return _graded("blurred", text, remedy, size > FAR_BLUR_PX, size, "px")


def all_pressed_finding() -> Finding:
    """Return that nothing untouched is left to compare with."""
    text = tr(
        "nearly everything is pressed: too little untouched membrane is left to compare with, and "
        "all heights may be wrong by one constant"
    )
    remedy = tr("Press so that a part of the field stays free, also at its boundary")
    return _graded("all_pressed", text, remedy, False)


def compressed_finding(lost: float, *, far: bool = False) -> Finding | None:
    """Return that fine detail of the image is lost.

    Parameters
    ----------
    lost : float
        Of :meth:`~gelpolight_core.image.grain.Grain.lost`.
    far : bool, optional
        Whether nothing of the membrane is recognised.
    """
    if lost <= 1.0:
        return None
    text = tr("fine detail of the image is lost: it was compressed, resized or filtered")
    remedy = tr(
        "Use the camera's images as at calibration: PNG or TIFF, without noise reduction or "
        "other processing"
    )
    return _graded("compressed", text, remedy, far, lost)


def saturated_finding(share: float, changed: float = 1.0) -> Finding | None:
    """Return that much of the field is saturated, and of its `changed` share."""
    if share < max(SATURATED_SHARE, SATURATED_CONTACT * changed):
        return None
    text = tr("{p:.0f} % of the membrane is saturated").format(p=100.0 * share)
    remedy = tr("Restore the exposure of the calibration, and shade the sensor")
    return _graded("saturated", text, remedy, share > MOSTLY_SATURATED, 100.0 * share, "%")


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
    text = tr("something dark lies on the membrane, the window or the lens")
    remedy = tr("Clean the sensor and the lens")
    return _graded("dirt", text, remedy, False, float(np.count_nonzero(runs)), "mm2")


def bad_pixel_findings(
    share: float, count: int, columns: Sequence[int], rows: Sequence[int]
) -> list[Finding]:
    """Return lines and single pixels that do not follow the light."""
    remedy = tr("Calibrate again, so that they are left out, or replace the camera")
    found = []
    for kind, places in ((tr("column"), columns), (tr("row"), rows)):
        if places:
            text = tr("the camera has a dead or hot {kind} at {places}")
            text = text.format(kind=kind, places=", ".join(str(n) for n in places[:5]))
            line = _graded("bad_line", text, remedy, False, float(len(places)), "")
            found.append(replace(line, verdict=Verdict.FAIL))
    if share > BAD_SHARE and count >= LEAST_BAD:
        text = tr("{p:.2g} % of the pixels are dead or hot").format(p=100.0 * share)
        far = share > FAR_SHARE
        found.append(_graded("bad_pixels", text, remedy, far, 100.0 * share, "%"))
    return found


def dark_finding() -> Finding:
    """Return that there is no light."""
    text = tr("the image is dark: the LEDs are off, or the lens is covered")
    return _graded("dark", text, tr("Switch the LEDs on and uncover the lens"), True)


def swapped_finding(order: Sequence[int]) -> Finding:
    """Return that the channels come in another order."""
    text = tr("the colours come in the order {letters} instead of RGB")
    text = text.format(letters="".join("RGB"[k] for k in order))
    remedy = tr("Set the camera's colour order as at calibration")
    return _graded("colour_order", text, remedy, True)


def stranger_finding() -> Finding:
    """Return that nothing in the image looks like this sensor's untouched membrane."""
    remedy = tr(
        "Use the calibration of the sensor that captured the image; if it is the "
        "right one, press less of the field, and seat camera and elastomer"
    )
    text = tr(
        "nothing in the image looks like this sensor's untouched membrane: it is another sensor, "
        "or nearly everything is pressed"
    )
    return _graded("other_sensor", text, remedy, True)


def _graded(
    key: str, text: str, remedy: str, far: bool, value: float = math.nan, unit: str = ""
) -> Finding:
    """Return a finding that makes the depth meaningless where the fault is `far`."""
    verdict = Verdict.FAIL if far else Verdict.WARN
    heights = Heights.MEANINGLESS if far else Heights.DOUBTFUL
    return Finding(key, text, value, unit, verdict=verdict, remedy=remedy, heights=heights)
