"""The faults of an image, the most important first: text, remedy and judge of each.

To add a fault, write its judge and its entry in `FAULTS`. A change is stated where it is larger
than its standard deviation explains and costs more than a percent of the heights; where it costs a
fifth of them, they mean nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.finding import Finding, HeightReliability, Verdict

from .change_fit import ROWS
from .explanations import OTHERS
from .fault_limits import ALONE, BLUR_PX, DARK, GAIN, MOSTLY_SATURATED, OFFSET, SHIFT_PX, SIGMAS
from .frame_evidence import OF_PARTS, FrameEvidence, Likeness, Symptom
from .frame_health import FrameHealth, LightGain
from .global_change import LEAST_START, scatter_of_cells
from .health_samples import BLUR, BLURS_PX, RUN

FAR = 20.0
"""Percent of the heights from which on an error makes them meaningless; it grows with the square of
a blur. A gain of any size is corrected."""
ROUNDING = 0.125
"""Means of four pixels that are rounded to whole numbers, as in images of half the size, are too
large by an eighth of a step."""
SATURATED_SHARE, SATURATED_CONTACT = 0.01, 0.05
"""Of the field, and of its part that has changed: a shiny membrane saturates in a contact, and
less than a twentieth of it that is left out costs little."""
DIRT_CHANGE, DIRT_SPREAD, DIRT_RUNS = -0.06, 0.12, 2
"""Dirt darkens the channels alike; a slope does not."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of an image, with its remedy and the rule that finds it.

    Attributes
    ----------
    key : str
        Its name in files and scripts.
    text : str
        What was found. `n` is its size without its sign, `how` and `more` its sign in words.
    remedy : str
        What to do, as a sentence without a full stop.
    judge : callable
        Yields the symptoms that a frame shows. None where other modules judge it, from several
        frames or from the file.
    unit : str
        Unit of its size.
    seen_in : tuple of Likeness
        Frames in which it can be judged.
    hides : tuple of str
        Faults that are not named beside it, because it explains them.
    only_with : tuple of str or None
        The only faults that can be judged beside it. None: all.
    fails : bool
        Whether its verdict is "fail" also where the depth is only doubtful.
    rival : str
        Its name in the text of another fault that is as likely, if it is an explanation.
    """

    key: str
    text: str
    remedy: str
    judge: Callable[[FrameEvidence], Iterable[Symptom]] = lambda _frame: ()
    unit: str = ""
    seen_in: tuple[Likeness, ...] = (Likeness.MEMBRANE,)
    hides: tuple[str, ...] = ()
    only_with: tuple[str, ...] | None = None
    fails: bool = False
    rival: str = ""

    def findings(self, frame: FrameEvidence) -> list[Finding]:
        """Return what a frame shows of it."""
        is_seen = frame.likeness in self.seen_in
        return [self.finding(symptom) for symptom in self.judge(frame)] if is_seen else []

    def finding(self, symptom: Symptom) -> Finding:
        """Return the finding of a symptom."""
        value = symptom.value
        how = "brighter" if value > 0.0 else "darker"
        more = "more" if value > 0.0 else "less"
        return Finding(
            self.key,
            self.text.format(n=abs(value), how=how, more=more, **symptom.facts),
            value,
            self.unit,
            verdict=Verdict.FAIL if symptom.far or self.fails else Verdict.WARN,
            remedy=self.remedy,
            heights=HeightReliability.MEANINGLESS if symptom.far else HeightReliability.DOUBTFUL,
        )


def judge_dark(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether all light is missing."""
    if (frame.light < DARK).all():
        yield Symptom(far=True)


def judge_compressed(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the image was processed: its grain is another one, or it is sharper."""
    # Missing light and swapped colours change the grain, too.
    is_other_light = frame.likeness is Likeness.NONE and (
        (frame.light < DARK).any() or frame.colour_order is not None
    )
    if not is_other_light and (frame.processed > 1.0 or frame.is_sharper):
        yield Symptom(frame.processed, far=not frame.untouched.any())


def judge_all_pressed(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether a press of the whole field explains what looks like other light."""
    if frame.likeness is Likeness.PRESSED:
        yield Symptom()


def judge_led_off(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether one LED is off. Crosstalk then changes the pattern of all channels."""
    if frame.likeness is Likeness.NONE:
        for k in np.flatnonzero(frame.light < DARK):
            change = float(frame.light[k]) - 1.0
            yield Symptom(100.0 * change, True, {"name": CHANNEL_KEYS[int(k)]})
    elif frame.odd_channel is not None and frame.odd_change < DARK - 1.0:
        yield Symptom(100.0 * frame.odd_change, True, {"name": CHANNEL_KEYS[frame.odd_channel]})


def judge_led_weak(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether one LED is weaker or brighter."""
    if frame.has_moved_far or frame.odd_channel is None or frame.odd_change < DARK - 1.0:
        return
    yield Symptom(100.0 * frame.odd_change, facts={"name": CHANNEL_KEYS[frame.odd_channel]})


def judge_exposure(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether all light has changed alike."""
    if not frame.has_moved_far and frame.odd_channel is None and frame.has_clear_gain:
        mean = float(frame.excess.values[:6:2].mean())
        if abs(mean) > max(SIGMAS * float(frame.excess.sd[:6:2].max()), GAIN):
            yield Symptom(100.0 * mean)


def judge_uneven(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the light has another distribution over the image."""
    if not frame.has_moved_far and frame.explains("uneven"):
        share = frame.samples.shapes[:, 1:] @ frame.values_of("uneven")
        share = share - share[frame.untouched].mean()
        largest = float(share[np.argmax(np.abs(share))])
        if abs(largest) > GAIN:
            yield Symptom(100.0 * largest, far=abs(largest) > FAR * GAIN)


def judge_rows(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the light changes from row to row."""
    if not frame.has_moved_far and frame.explains(ROWS):
        assert frame.explained is not None and frame.explained.rows is not None
        largest = frame.explained.rows.largest
        if largest > GAIN:
            yield Symptom(100.0 * largest)


def judge_mixing(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the camera mixes its colours in another way."""
    if not frame.has_moved_far and frame.explains("colour_mixing"):
        largest = float(np.abs(frame.values_of("colour_mixing")).max())
        if largest > ALONE * GAIN:
            yield Symptom(100.0 * largest)


def judge_tone(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the camera has another curve of brightness."""
    if not frame.has_moved_far and frame.weighs_more("tone", "blurred"):
        light = frame.samples.cell_light
        power, curve = frame.values_of("tone")
        size = float(np.ptp(power * np.log(light) + curve * light))
        if size > GAIN:
            yield Symptom(100.0 * size)


def judge_room_light(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether there is more or less room light, unless something else explains the frame."""
    if frame.explained is not None and not frame.explains("room_light"):
        return
    offsets, sd = frame.excess.values[1:6:2], frame.excess.sd[1:6:2]
    k = int(np.argmax(np.abs(offsets)))
    offset, limit = float(offsets[k]), max(OFFSET, ROUNDING * frame.step)
    of_all = limit + SIGMAS * float(sd.max()) / math.sqrt(3.0)
    of_one = ALONE * limit + SIGMAS * float(sd[k])
    size = max(abs(float(offsets.mean())) / of_all, abs(offset) / of_one)
    far = abs(offset) > FAR * OFFSET
    needed = 1.0 if frame.has_clear_gain else SIGMAS
    if not (size > needed and (far or not frame.has_moved_far)):
        return
    if frame.explained is not None or frame.is_likelier_with("room_light"):
        yield Symptom(100.0 * offset, far)


def judge_colour_order(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the colours come in another order."""
    if frame.colour_order is not None:
        yield Symptom(far=True, facts={"letters": frame.colour_order})


def judge_other_sensor(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the image is of another sensor: at no place, or with another texture."""
    if frame.likeness is Likeness.NONE:
        if frame.searched_px is None:
            yield Symptom(far=True)
    elif frame.fit.share < LEAST_START:
        blurred = _blur_cost(frame) > FAR and frame.processed <= 1.0
        if blurred and frame.shift_px is None and not frame.is_smooth:
            yield Symptom(far=True)


def judge_saturated(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether much of the field, and of its changed part, is saturated."""
    least = max(SATURATED_SHARE, SATURATED_CONTACT * (1.0 - frame.fit.share))
    if frame.likeness is Likeness.OVEREXPOSED or not frame.full_share < least:
        yield Symptom(100.0 * frame.full_share, far=frame.full_share > MOSTLY_SATURATED)


def judge_camera_moved(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the camera has moved."""
    if frame.shift_px is None:
        return
    if frame.shift_px == frame.searched_px:
        yield Symptom(frame.shift_px, frame.shift_px > FAR * SHIFT_PX, {"beyond": ""})
    elif frame.has_moved_far:  # the fit cannot follow so far
        yield Symptom(frame.shift_px, frame.excess.share < LEAST_START, {"beyond": " or more"})
    else:
        yield Symptom(frame.shift_px, facts={"beyond": ""})


def judge_blurred(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether the texture is blurred."""
    cost = _blur_cost(frame)
    if cost > 1.0 and not frame.weighs_more("tone", "blurred"):
        yield Symptom(_blur_px(frame), far=cost > FAR)


def _blur_px(frame: FrameEvidence) -> float:
    """Return the size of the blur, 0 where it is within noise or there is no texture."""
    strength, common = frame.samples.blur_strength, frame.excess
    if not strength.size or common.values[BLUR] < SIGMAS * common.sd[BLUR]:
        return 0.0
    return float(np.interp(common.values[BLUR], strength, (0.0, *BLURS_PX)))


def _blur_cost(frame: FrameEvidence) -> float:
    """Return the error of the heights by blur, in percent."""
    return (_blur_px(frame) / BLUR_PX) ** 2


def judge_dirt(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether something dark is on the membrane or in the path of the light.

    Channels that show the light of one LED alone, by crosstalk, are alike on a slope, too: only
    runs of pixels that all LEDs light are judged.
    """
    samples, common, reference = frame.samples, frame.fit, frame.reference
    led_light = reference.unmix @ samples.run_light
    lit_mask = (led_light > 0.5 * samples.run_light).all(axis=0)
    changes = reference.unmix @ reference.run_change / np.where(lit_mask, led_light, 1.0)
    red, green, blue = (changes[k] - common.values[2 * k] for k in range(3))
    highest = np.maximum(np.maximum(red, green), blue)
    lowest = np.minimum(np.minimum(red, green), blue)
    dark_mask = (highest < DIRT_CHANGE) & (highest - lowest < -DIRT_SPREAD * highest)
    if not dark_mask.any():
        return
    dark_mask &= lit_mask & ~common.untouched[samples.run_cell]
    runs = np.bincount(samples.run_cell[dark_mask], minlength=samples.count.size)
    neighbours = runs + runs[samples.beside].sum(axis=1)
    if neighbours.max() >= DIRT_RUNS:
        at = samples.run_cell.repeat(RUN) == neighbours.argmax()
        row, column = samples.corner[at].mean(axis=0)
        place = {"column": f"{column:.0f}", "row": f"{row:.0f}"}
        yield Symptom(float(np.count_nonzero(runs)), facts=place)


def judge_bad_pixels(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether single pixels do not follow the light."""
    pixels = frame.bad_pixels
    if pixels.has_single:
        yield Symptom(100.0 * pixels.share, far=pixels.too_many)


def judge_hair(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether a thin line of pixels does not follow the light."""
    if frame.bad_pixels.thread is not None:
        column, row = frame.bad_pixels.thread
        yield Symptom(facts={"column": column, "row": row})


def judge_bad_line(frame: FrameEvidence) -> Iterator[Symptom]:
    """Judge whether lines of pixels do not follow the light, unless most pixels are bad."""
    pixels = frame.bad_pixels
    if frame.likeness is Likeness.COVERED and pixels.too_many:
        return
    for kind, numbers in (("column", pixels.columns), ("row", pixels.rows)):
        if numbers:
            places = ", ".join(str(n) for n in numbers[:5])
            yield Symptom(float(len(numbers)), facts={"kind": kind, "places": places})


_AGAIN = "set to zero or capture the background again"
_NEW_CAMERA = "Calibrate again, so that they are left out, or replace the camera"
LIGHT = ("led_off", "uneven", "rows", "colour_mixing", "led_weak", "exposure", "room_light")
"""Changes of the light."""
CORRECTABLE = ("exposure", "led_weak", "uneven", "rows", "colour_mixing")
SHOWS_PIXELS = (Likeness.MEMBRANE, Likeness.COVERED, Likeness.PRESSED)

# A pattern of light changes its mean, too: patterns come before what changes all light.
FAULTS = (
    Fault(
        "dark",
        "the image is dark: the LEDs are off, or the lens is covered",
        "Switch the LEDs on and uncover the lens",
        judge_dark,
        seen_in=(Likeness.MEMBRANE, Likeness.NONE),
        only_with=(),
    ),
    Fault(
        "compressed",
        "the camera or a program has processed the image: fine detail is lost or exaggerated",
        "Use the camera's images as at calibration: PNG or TIFF, without compression, noise "
        "reduction, sharpening, resizing or other processing",
        judge_compressed,
        seen_in=(Likeness.MEMBRANE, Likeness.NONE),
        # Other detail looks like a movement and like blur.
        hides=("blurred", "dirt"),
    ),
    Fault(
        "all_pressed",
        "nearly everything is pressed: too little untouched membrane is left to compare with, and "
        "all heights may be wrong by one constant",
        "Press so that a part of the field stays free, also at its boundary",
        judge_all_pressed,
        seen_in=(Likeness.MEMBRANE, Likeness.PRESSED),
        only_with=("bad_pixels", "bad_line"),
        rival="a press of nearly everything",
    ),
    Fault(
        "led_off",
        "the {name} LED is off",
        "Check its cable and driver, then calibrate again",
        judge_led_off,
        "%",
        (Likeness.MEMBRANE, Likeness.NONE),
    ),
    Fault(
        "uneven",
        "parts of the image are up to {n:.1f} % {how} than at calibration",
        f"Clean the lens and check that nothing shades it; then {_AGAIN}",
        judge_uneven,
        "%",
        rival="light that changes over the image",
    ),
    Fault(
        "rows",
        "the light changes from row to row of the image, by {n:.1f} %: LEDs or mains flicker, or "
        "the exposure changes in mid frame",
        "Lock exposure and gain, and set an exposure of whole periods of the flicker",
        judge_rows,
        "%",
        rival="light that changes from row to row",
    ),
    Fault(
        "colour_mixing",
        "the camera mixes its colours in another way than at calibration, by {n:.1f} %",
        "Restore saturation, hue and colour matrix of the camera as at calibration",
        judge_mixing,
        "%",
        rival="colours that the camera mixes in another way",
    ),
    Fault(
        "tone",
        "the camera has another curve of brightness than at calibration: contrast, gamma or tone "
        "mapping changed it by {n:.1f} %",
        "Restore contrast and gamma of the camera as at calibration, and switch tone mapping off",
        judge_tone,
        "%",
        # A curve looks like room light and changes the grain.
        hides=("room_light", "compressed"),
        rival="another curve of brightness",
    ),
    Fault(
        "led_weak",
        "the {name} LED is {n:.1f} % {how} than at calibration",
        f"Let the LEDs warm up and check their current; then {_AGAIN}",
        judge_led_weak,
        "%",
    ),
    Fault(
        "exposure",
        "the light is {n:.1f} % {how} than at calibration: exposure, gain or LEDs changed",
        f"Restore the camera settings of the calibration, or {_AGAIN}",
        judge_exposure,
        "%",
    ),
    Fault(
        "room_light",
        "there is {n:.2f} % of full scale {more} room light than at calibration",
        "Shade the sensor as at calibration, and check the camera's black level",
        judge_room_light,
        "%",
        rival="other room light",
    ),
    Fault(
        "colour_order",
        "the colours come in the order {letters} instead of RGB",
        "Set the camera's colour order as at calibration",
        judge_colour_order,
        seen_in=(Likeness.NONE,),
    ),
    Fault(
        "other_sensor",
        "nothing in the image looks like this sensor's untouched membrane: it is another sensor, "
        "or nearly everything is pressed",
        "Use the calibration of the sensor that captured the image; if it is the right one, press "
        "less of the field, and seat camera and elastomer",
        judge_other_sensor,
        seen_in=(Likeness.MEMBRANE, Likeness.NONE),
        only_with=(),
    ),
    Fault(
        "saturated",
        "{n:.0f} % of the membrane is saturated",
        "Restore the exposure of the calibration, and shade the sensor",
        judge_saturated,
        "%",
        (Likeness.MEMBRANE, Likeness.OVEREXPOSED),
    ),
    Fault(
        "camera_moved",
        "the camera has moved against the membrane by {n:.1f} px{beyond}",
        "Seat the camera and the elastomer as at calibration, or calibrate again",
        judge_camera_moved,
        "px",
        (Likeness.MEMBRANE, Likeness.NONE),
        # Specks that have moved or become weaker are not dirt.
        hides=("blurred", "dirt"),
        rival="a movement of the camera",
    ),
    Fault(
        "blurred",
        "the image is blurred by {n:.1f} px more than at calibration",
        "Focus the lens and clean it; calibrate again if the focus was changed",
        judge_blurred,
        "px",
        hides=("dirt",),
        rival="a blurred image",
    ),
    Fault(
        "dirt",
        "something dark lies on the membrane, the window or the lens, at column {column} and row "
        "{row} of the image",
        "Clean the sensor and the lens",
        judge_dirt,
        "mm2",
    ),
    Fault(
        "hair",
        "a hair or a scratch lies on the membrane, the window or the lens, at column {column} and "
        "row {row} of the image",
        "Clean the sensor and the lens, and look for damage",
        judge_hair,
        seen_in=SHOWS_PIXELS,
        hides=("dirt",),
    ),
    Fault(
        "bad_pixels",
        "{n:.2g} % of the pixels are dead or hot",
        _NEW_CAMERA,
        judge_bad_pixels,
        "%",
        SHOWS_PIXELS,
    ),
    Fault(
        "bad_line",
        "the camera has a dead or hot {kind} at {places}",
        _NEW_CAMERA,
        judge_bad_line,
        seen_in=SHOWS_PIXELS,
        hides=("dirt",),
        fails=True,
    ),
    Fault(
        "not_recovered",
        "the gel has not recovered: {n:.1f} % of the last press remains",
        "Wait before the next press, and press for less time",
        unit="%",
    ),
    Fault(
        "file_compressed",
        "the compression of the image file rounds its values by more than their noise",
        "Save images without loss, as at calibration: PNG or TIFF",
        unit="grey levels",
    ),
)
"""All faults, the most important first."""
_BY_KEY = {fault.key: fault for fault in FAULTS}
KEYS = tuple(_BY_KEY)
UNJUDGED = tuple(key for key in KEYS if key not in ("other_sensor", "colour_order", "dark"))
"""Faults that cannot be judged where too little untouched membrane is seen."""


def make_fault(key: str, value: float) -> Finding:
    """Return the finding of a fault that has no judge."""
    return _BY_KEY[key].finding(Symptom(value))


def find_faults(frame: FrameEvidence) -> list[Finding]:
    """Return the findings of all faults that a frame shows."""
    findings: list[Finding] = []
    hidden = set[str]()
    for fault in FAULTS:
        if fault.key in hidden:
            continue
        named = fault.findings(frame)
        if named:
            findings += [_with_rival(finding, frame) for finding in named]
            # An image that is like nothing has one fault: the first one that explains it.
            only_with = () if frame.likeness is Likeness.NONE else fault.only_with
            hidden.update(fault.hides if only_with is None else {*KEYS} - {fault.key, *only_with})
    return [finding for finding in findings if finding.key not in hidden]


def _with_rival(finding: Finding, frame: FrameEvidence) -> Finding:
    """Return a finding with the explanation that is as likely, if there is one."""
    rival = None if frame.explained is None else frame.explained.instead.get(finding.key)
    if rival is None:
        return finding
    return replace(finding, text=f"{finding.text}, or as likely {_BY_KEY[rival].rival}")


def judge_frame(frame: FrameEvidence) -> FrameHealth:
    """Return the health of a frame: its faults, and the correction of its light."""
    findings = find_faults(frame)
    keys = {finding.key for finding in findings}
    if frame.likeness is Likeness.COVERED or "all_pressed" in keys:
        share = 0.0 if "all_pressed" in keys else frame.fit.share
        return health_of(findings, unknown=UNJUDGED, untouched=share)
    if frame.likeness is not Likeness.MEMBRANE or keys & {"dark", "other_sensor"}:
        return health_of(findings, untouched=frame.fit.share)
    gain = light_gain(frame, findings)
    if gain is not None:
        findings = [as_corrected(finding) for finding in findings]
    needs = {"compressed": frame.reference.grain, "blurred": frame.samples.blur_strength.size}
    return health_of(
        findings,
        unknown=tuple(key for key, need in needs.items() if not need),
        untouched=frame.fit.share,
        cells=frame.fit.change,
        light=gain,
    )


def health_of(
    findings: list[Finding],
    *,
    unknown: tuple[str, ...] = (),
    untouched: float = 1.0,
    cells: NDArray[np.float64] | None = None,
    light: LightGain | None = None,
) -> FrameHealth:
    """Return the health with findings in the order of their severity."""

    def weight(finding: Finding) -> tuple[bool, bool, bool, int]:
        severe = finding.verdict is Verdict.FAIL
        return not finding.meaningless, not severe, not finding.doubtful, KEYS.index(finding.key)

    ordered = tuple(sorted(findings, key=weight))
    return FrameHealth(ordered, unknown, untouched, cells, light)


def light_gain(frame: FrameEvidence, findings: Sequence[Finding]) -> LightGain | None:
    """Return the correction of the light, or None if it is the same or too different."""
    if frame.has_moved_far:
        return None
    changes = {finding.key: finding for finding in findings if finding.key in LIGHT}
    alike = [key for key in changes if key not in OF_PARTS]
    corrected = frame.reference.usual.corrected
    gain = None
    if corrected:
        sd = scatter_of_cells(frame.samples, frame.fit)
        gain = LightGain(1.0 + frame.fit.gain, sd)
    elif not any(changes[key].meaningless for key in alike):
        gain = _common_gain(frame, alike)
    parts = [key for key in OF_PARTS if frame.explains(key)]
    if frame.explained is None or not parts:
        return gain
    if "uneven" in changes and changes["uneven"].meaningless and not corrected:
        return None
    gain = gain or LightGain(np.ones(3), frame.fit.gain_sd)
    shape = mixing = tone = None
    if "uneven" in parts:
        by_shape = frame.values_of("uneven")
        shape = np.concatenate([[-frame.samples.shapes[:, 1:].mean(axis=0) @ by_shape], by_shape])
    if "colour_mixing" in parts:
        mixing = np.eye(3)
        for (k, j), share in zip(OTHERS, frame.values_of("colour_mixing"), strict=True):
            mixing[k, j] = share / gain.share[j]
    if "tone" in parts:
        tone = frame.values_of("tone")
    rows = frame.explained.rows
    sds = [frame.sd_of(key) for key in parts if key != ROWS]
    sds += [] if rows is None else [rows.sd]
    sd = np.hypot(gain.sd, math.hypot(*sds))
    return LightGain(gain.share, sd, shape, rows, mixing, tone)


def _common_gain(frame: FrameEvidence, changes: Sequence[str]) -> LightGain | None:
    """Return the correction of a common change, where one is stated or larger than its noise."""
    gain, sd = frame.excess.gain, frame.excess.gain_sd
    if any(key not in CORRECTABLE for key in changes):
        # With room light, which remains a fault, the gain is that of the joint fit.
        gain, sd = frame.excess.values[:6:2], frame.excess.sd[:6:2]
    is_stated = any(key in CORRECTABLE for key in changes)
    small = not changes and bool((np.abs(gain) > SIGMAS * sd).any())
    return LightGain(1.0 + gain, sd) if is_stated or small else None


def as_corrected(change: Finding) -> Finding:
    """Return the finding of a change of the light that is corrected.

    A large uneven change need not have the shapes that were fitted, so it is not.
    """
    if change.key not in CORRECTABLE or change.meaningless:
        return change
    remedy = f"The depth is corrected for this. {change.remedy}"
    return replace(change, remedy=remedy, verdict=Verdict.WARN, heights=HeightReliability.STATED)
