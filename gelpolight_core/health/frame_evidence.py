"""What a frame shows beside the background of its calibration: measured once, for all faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.image.bad_pixels import FAR_SHARE
from gelpolight_core.image.grain import COARSEST_STEP, block_grain, level_step

from .background_reference import BackgroundReference
from .change_fit import ALIKE, FINE, ROWS, ChangeFit, ChangeModel, FrameChange, FrameSums
from .explanations import GAINS, MOVED, OFFSETS, PRESSED
from .fault_limits import (
    ALONE,
    CLEAR,
    GAIN,
    LEAST_UNTOUCHED,
    MOSTLY_SATURATED,
    SHIFT_PX,
    SIGMAS,
)
from .global_change import LEAST_START, GlobalChange, common_change
from .health_samples import BLUR, PARAMETERS, SHIFT_U, SHIFT_V, choose_samples, compare_samples
from .movement import FOLLOWED_PX, Movement, search_movement
from .press_scatter import HealthyPressScatter
from .press_test import press_effects
from .robust_fit import CORRELATED

BOUNDARY_CHANGE = 0.02
"""Largest change of light of most of the boundary, where less of the field is untouched: a contact
covers the rest."""
OF_PARTS = ("uneven", "colour_mixing", "tone", ROWS)
"""Explanations that change the light of parts of the field in other ways."""
LEVEL_8_BIT = 1.0 / 255.0
BAD_SHARE, LEAST_BAD = 1e-4, 3
"""Share of the pixels, and number of them, from which on they are reported."""


class Likeness(StrEnum):
    """Which part of a frame looks like the untouched membrane of its calibration."""

    MEMBRANE = "membrane"
    """Enough of the field."""
    COVERED = "covered"
    """The boundary, or bad pixels hide it: the rest cannot be judged."""
    PRESSED = "pressed"
    """None: a press of the whole field explains the frame."""
    OVEREXPOSED = "overexposed"
    """None: most of the field is saturated."""
    NONE = "none"
    """None, and the reason is one of the faults."""


@dataclass(frozen=True, slots=True)
class BadPixelCount:
    """Pixels of a frame that do not follow the light.

    Attributes
    ----------
    share : float
        Share of the searched pixels that are dead or hot alone.
    count : int
        Their number.
    columns, rows : tuple of int
        Dead or hot lines.
    thread : (column, row) or None
        A place on a chain of other pixels that do not follow the light: a hair, or a scratch.
    """

    share: float = 0.0
    count: int = 0
    columns: tuple[int, ...] = ()
    rows: tuple[int, ...] = ()
    thread: tuple[int, int] | None = None

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return self.has_single or bool(self.columns or self.rows)

    @property
    def has_single(self) -> bool:
        """Whether there are more single ones than a healthy sensor has."""
        return self.share > BAD_SHARE and self.count >= LEAST_BAD

    @property
    def too_many(self) -> bool:
        """Whether single ones hide the frame."""
        return self.has_single and self.share > FAR_SHARE


@dataclass(frozen=True, slots=True)
class Symptom:
    """A fault as it appears in a frame.

    Attributes
    ----------
    value : float
        Its size, in the unit of the fault.
    far : bool
        Whether the depth means nothing.
    facts : mapping
        Other words of the text.
    """

    value: float = math.nan
    far: bool = False
    facts: Mapping[str, object] = field(default_factory=dict)


class HealthReference:
    """Healthy images of one sensor, with buffers for the frame that is compared with them.

    Parameters
    ----------
    calibration : BackgroundReference
        The sensor.
    usual : HealthyPressScatter
        Change of the light by healthy presses.
    crosstalk : (3, 3)
        Response of the channels to the LEDs.
    leds_mm : (3, 3) or None
        Positions of the LEDs, if they are known.

    Attributes
    ----------
    samples : HealthSamples
        Samples of the background.
    grain : Grain or None
        Fine detail of the calibration's images.
    unmix : (3, 3)
        Light of each LED from that of the channels.
    model : ChangeModel
        Explanations of a change.
    change, square, full, run_change
        Sums over the last frame, from
        :func:`~gelpolight_core.health.health_samples.compare_samples`.
    """

    def __init__(
        self,
        calibration: BackgroundReference,
        usual: HealthyPressScatter,
        crosstalk: Float64Array,
        leds_mm: Float64Array | None,
    ) -> None:
        self.samples, self.grain = choose_samples(calibration), calibration.grain
        self.usual = usual
        self.unmix: Float64Array = np.asarray(np.linalg.inv(crosstalk), np.float64)
        cells, runs = self.samples.count.size, self.samples.run_cell.size
        press = None if leds_mm is None else press_effects(self.samples, leds_mm, self.unmix)
        self.model = ChangeModel(self.samples, calibration.camera.height, press)
        self.change = np.zeros((cells, PARAMETERS))
        self.square, self.full = np.zeros(cells), np.zeros(cells)
        self.run_change = np.zeros((3, runs))

    def compare(self, raw: NDArray[Any], light: Float32Array) -> GlobalChange:
        """Sum up a frame, and fit the common change of its light."""
        s = self.samples
        background = s.corner, s.part, s.run_cell, s.expected, s.effects, s.weight
        sums = self.change, self.square, self.full, self.run_change
        compare_samples(raw, light, np.float32(SATURATED), *background, *sums)
        return common_change(s, self.change, self.square, self.full)

    @property
    def sums(self) -> FrameSums:
        """A copy of the sums over the last frame."""
        sums = self.change, self.square, self.full, self.run_change
        return FrameSums(*(part.copy() for part in sums))

    @property
    def light(self) -> Float64Array:
        """Change of each cell's light (cells, 3), as a share."""
        return self.change[:, :6:2] / self.samples.by_gain


class FrameEvidence:
    """What one frame shows: the judges of all faults read it.

    Parameters
    ----------
    reference : HealthReference
        Healthy images of the sensor. Its buffers are in use until the last judge has finished.
    raw : (height, width, 3) uint8 or uint16
        The frame without its bad pixels.
    levels : (3, levels) float32
        Linear light of every number.
    whole : bool
        Whether to search for large movements of the camera.
    bad_pixels : BadPixelCount
        Those that were removed from it.

    Attributes
    ----------
    full_share : float
        Saturated share of the field.
    fit : GlobalChange
        Change of the light, the same in all parts of the field.
    likeness : Likeness
        Which part of the frame looks like the untouched membrane.
    """

    def __init__(
        self,
        reference: HealthReference,
        raw: NDArray[Any],
        levels: Float32Array,
        *,
        whole: bool,
        bad_pixels: BadPixelCount,
    ) -> None:
        self.reference, self.samples, self.bad_pixels = reference, reference.samples, bad_pixels
        self._raw, self._levels, self._whole = raw, levels, whole
        self.fit = reference.compare(raw, levels)
        self.full_share = float(reference.full.sum() / self.samples.count.sum())
        self._sums = sums = reference.sums
        self._has_jumped = False
        self.explained = self._explain(sums)
        if whole and self.explained is not None and not self.explained.is_flicker:
            self._compare_with_movement(self.explained)
        self.likeness = self._compare_with_membrane()

    def _compare_with_membrane(self) -> Likeness:
        if self.explains(PRESSED):
            return Likeness.PRESSED
        if self.fit.share >= LEAST_UNTOUCHED:
            return Likeness.MEMBRANE
        if self.bad_pixels.too_many or self._boundary_fits():
            return Likeness.COVERED
        return Likeness.OVEREXPOSED if self.full_share > MOSTLY_SATURATED else Likeness.NONE

    def _compare_with_movement(self, change: FrameChange) -> None:
        """Take a movement by more than the fit can follow instead of a change of the light.

        It is taken if the frame is more likely with its few parameters.
        """
        found, model = self._search, self.reference.model
        if found is None or found.size_px <= FOLLOWED_PX:
            return
        parameters = sum(model.at[key].size for key in change.fit.keys) - len(GAINS)
        if change.rows is not None:
            parameters += change.rows.shares.size
        if self._moved_evidence > change.fit.evidence(self._as_it_is, parameters):
            self.explained, self.fit, self._has_jumped = None, found.common, True

    def _explain(self, sums: FrameSums) -> FrameChange | None:
        """Explain the frame, and fit the common change again without what only some parts show.

        An explanation that leaves less than a part of the field untouched explains nothing.
        """
        reference, before = self.reference, self.fit
        model = reference.model
        as_before = self._rest_is_as_before(before)
        if as_before and before.share >= LEAST_START and not model.may_change_by_row(sums):
            return None
        change = model.explain(sums, reference.usual.evidence)
        # Where a part looks as at calibration, the rest is a contact, or light flickers.
        if as_before and not change.is_flicker:
            return None
        if not change.worth:
            return None
        if PRESSED in change.worth:
            return change
        local = model.local(change.fit, [key for key in OF_PARTS if key in change.fit.keys])
        moved = model.local(change.fit, [key for key in (MOVED,) if key in change.fit.keys])
        local[:, FINE] += moved[:, FINE] - moved[:, FINE].mean(axis=0)
        left = model.without(change.sums, local)
        self.fit = common_change(self.samples, left.change, left.square, left.full)
        if self.fit.share < min(LEAST_START, before.share):
            self.fit = before
            return None
        return change

    def _rest_is_as_before(self, common: GlobalChange) -> bool:
        """Return whether the untouched part looks as at calibration: then the rest is a contact."""
        at = common.untouched
        if common.share < LEAST_UNTOUCHED:
            return False
        off = self.reference.light[at] ** 2 * self.samples.by_gain[at] / CORRELATED**2
        return float(off.mean()) < CLEAR**2

    def explains(self, key: str) -> bool:
        """Return whether an explanation makes the frame more likely."""
        return self.explained is not None and key in self.explained.worth

    def weighs_more(self, key: str, other: str) -> bool:
        """Return whether an explanation was found, and another one is worth less."""
        worth = {} if self.explained is None else self.explained.worth
        return key in worth and worth[key] > worth.get(other, 0.0)

    @property
    def is_smooth(self) -> bool:
        """Whether a blur alone explains the frame: another membrane has other light, too."""
        if self.explained is None or set(self.explained.fit.keys) != {"gain", "blurred"}:
            return False
        return self.explained.fit.light < CLEAR**2

    @property
    def is_sharper(self) -> bool:
        """Whether the image has more detail than at calibration."""
        return self.explains("blurred") and bool(self.values_of("blurred")[0] < 0.0)

    def values_of(self, key: str) -> Float64Array:
        """Return the parameters of an explanation that was found."""
        assert self.explained is not None
        return self.explained.fit.values[self._at(key)]

    def _at(self, key: str) -> slice:
        """Return the place of an explanation's parameters among those that were fitted."""
        assert self.explained is not None
        keys, at = self.explained.fit.keys, self.reference.model.at
        first = sum(at[other].size for other in keys[: keys.index(key)])
        return slice(first, first + at[key].size)

    def sd_of(self, key: str) -> float:
        """Return the largest standard deviation of a cell's light by an explanation."""
        assert self.explained is not None
        fit, model, own = self.explained.fit, self.reference.model, self._at(key)
        offsets = model.effects[:, OFFSETS] / self.samples.cell_light[..., None]
        effects = (model.effects[:, GAINS] + offsets)[..., model.at[key]]
        effects = effects - effects.mean(axis=0)
        variance = np.einsum("ckp,pq,ckq->ck", effects, fit.covariance[own, own], effects)
        return math.sqrt(max(float(variance.max(initial=0.0)), 0.0) * ALIKE)

    def _boundary_fits(self) -> bool:
        """Return whether the boundary looks as at calibration, where a contact covers the rest."""
        s = self.samples
        at_boundary = (s.beside == np.arange(s.count.size)[:, None]).any(axis=1) & (
            self.reference.full == 0.0
        )
        change = np.abs(self.reference.light[at_boundary]).max(axis=1)
        return bool(change.size and np.median(change) < BOUNDARY_CHANGE)

    # The light

    @cached_property
    def excess(self) -> GlobalChange:
        """The common change less the usual one of healthy presses."""
        return self.reference.usual.common(self.fit)

    @cached_property
    def light(self) -> Float64Array:
        """All light of each channel (3,) over that at calibration."""
        if self.likeness is Likeness.MEMBRANE:
            return 1.0 + self.fit.values[:6:2]
        light = self.reference.run_change.sum(axis=1) / self.samples.run_light.sum(axis=1)
        return np.asarray(1.0 + light)

    @cached_property
    def odd_channel(self) -> int | None:
        """The channel whose light has changed apart from the others, None if none has."""
        gains, sd = self.excess.values[:6:2], self.excess.sd[:6:2]
        median = float(np.median(gains))
        k = int(np.argmax(np.abs(gains - median)))
        apart = abs(float(gains[k]) - median)
        return k if apart > max(SIGMAS * float(sd[k]), ALONE * GAIN) else None

    @property
    def odd_change(self) -> float:
        """Change of its light, as a share."""
        return (
            math.nan
            if self.odd_channel is None
            else float(self.excess.values[2 * self.odd_channel])
        )

    @cached_property
    def has_clear_gain(self) -> bool:
        """Whether all light has changed by more than its noise.

        A shallow wide face in much noise looks like a gain and room light that cancel each other.
        """
        gain, sd = self.excess.gain, self.excess.gain_sd
        return abs(float(gain.mean())) > SIGMAS * float(sd.max())

    @cached_property
    def step(self) -> float:
        """Share of full scale from one number of the image to the next."""
        return 1.0 / np.iinfo(self._raw.dtype).max

    @cached_property
    def colour_order(self) -> str | None:
        """Order of the colours in which the frame looks like the membrane, such as BGR."""
        for order in permutations(range(3)):
            swapped = np.ascontiguousarray(self._raw[..., order])
            if self.reference.compare(swapped, self._levels[list(order)]).share > LEAST_START:
                return "".join("RGB"[k] for k in order)
        return None

    # The position, and the detail

    @cached_property
    def searched_px(self) -> float | None:
        """Movement of the membrane in the image by a search, None without one or a result."""
        is_near = self.likeness is Likeness.MEMBRANE and self._may_have_moved
        if self.is_smooth:
            return None
        if self._whole and (is_near or self.likeness is Likeness.NONE):
            return None if self._search is None else self._search.size_px
        return None

    @cached_property
    def _search(self) -> Movement | None:
        """The movement that makes the frame most like the membrane."""
        return search_movement(self.reference.model, self._raw, self._levels)

    @cached_property
    def _moved_evidence(self) -> float:
        """The logarithm of how much more likely the frame is with the movement searched for.

        It is that beyond what healthy presses reach.
        """
        if self._search is None:
            return -math.inf
        model, usual = self.reference.model, self.reference.usual.evidence
        moved = model.fit(self._search.sums, ("gain",))
        return moved.evidence(self._as_it_is, model.at[MOVED].size) - usual.get(MOVED, 0.0)

    @cached_property
    def _as_it_is(self) -> ChangeFit:
        """The fit of nothing but the gains."""
        return self.reference.model.fit(self._sums, ("gain",))

    @property
    def _may_have_moved(self) -> bool:
        """Whether the camera may have moved by more than the fit can follow."""
        values = self.excess.values
        far = math.hypot(values[SHIFT_U], values[SHIFT_V]) > 1.0 or values[BLUR] > 1.0
        return bool(far or self._has_jumped)

    @cached_property
    def shift_px(self) -> float | None:
        """Size of the movement, None where it is within noise."""
        if self.searched_px is not None:
            is_likely = self._moved_evidence > self._rival_of_movement
            if self.likeness is Likeness.NONE or (is_likely and self.searched_px > SHIFT_PX):
                return self.searched_px
        if self.likeness is not Likeness.MEMBRANE:
            return None
        values, sd = self.excess.values, self.excess.sd
        size = math.hypot(values[SHIFT_U], values[SHIFT_V])
        limit = max(SIGMAS * math.hypot(sd[SHIFT_U], sd[SHIFT_V]), SHIFT_PX)
        if self.explained is None:
            is_likely = size > limit and self._evidence.get(MOVED, 0.0) > self._rival_of_movement
            return size if is_likely else None
        if not self.explains(MOVED):
            return None
        if self._has_turned:
            moved = self.reference.model.local(self.explained.fit, (MOVED,))
            size = math.sqrt(float((moved[:, [SHIFT_U, SHIFT_V]] ** 2).sum(axis=1).mean()))
        return None if size < limit else size

    def is_likelier_with(self, key: str) -> bool:
        """Return whether an explanation alone makes the frame more likely."""
        return self._evidence.get(key, 0.0) > 0.0

    @cached_property
    def _evidence(self) -> dict[str, float]:
        """Of each explanation alone."""
        return self.reference.model.evidence(self._sums)

    @property
    def _rival_of_movement(self) -> float:
        """Evidence for the best other explanation: patterns of light look a little like a shift."""
        return max(0.0, *(found for key, found in self._evidence.items() if key != MOVED))

    @property
    def _has_turned(self) -> bool:
        """Whether a movement is more than a shift."""
        assert self.explained is not None
        sd = np.sqrt(np.diag(self.explained.fit.covariance)[self._at(MOVED)])
        return bool((np.abs(self.values_of(MOVED))[2:] > SIGMAS * sd[2:]).any())

    @property
    def has_moved_far(self) -> bool:
        """Whether the pattern of the light is not in its place."""
        return self.shift_px is not None and self.shift_px > FOLLOWED_PX

    @property
    def untouched(self) -> BoolArray:
        """Cells that look as at calibration."""
        if self.likeness is Likeness.MEMBRANE:
            return self.fit.untouched
        return np.zeros(self.samples.count.size, np.bool_)

    @cached_property
    def processed(self) -> float:
        """Change of the grain over the largest healthy one. Pressed parts show less of it."""
        grain, blocks = self.reference.grain, self.samples.blocks
        if grain is None or not blocks.size:
            return 0.0
        raw, levels, untouched = self._raw, self._levels, self.untouched
        by_levels = level_step(raw) / COARSEST_STEP
        if not untouched.any():
            return max(by_levels, grain.in_blocks(block_grain(raw, levels, blocks)))
        measured = block_grain(raw, levels, blocks[untouched])
        # The last number of a float image means that a value is missing.
        step, light = float((levels[:, -2] - levels[:, -3]).max()), float(self.light.mean())
        # Means of images of 8 bits come with 16 bits or as floats.
        by_noise = grain.processed(measured, max(step, LEVEL_8_BIT), light)
        return max(by_levels, grain.in_blocks(measured), by_noise)
