"""The health check of a frame: sample the image, fit the light, find faults."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.arrays import Array, Map, Mask
from gelpolight_core.bad_pixels import ACROSS, DOWN, bad_lines, differing, isolated_pixels
from gelpolight_core.finding import Finding
from gelpolight_core.image.coded import LightLevels, coded
from gelpolight_core.image.grain import block_grain
from gelpolight_core.light.finding import KEYS, Health, LightGain, health_of
from gelpolight_core.light.fit import (
    LEAST_START,
    CommonChange,
    Uneven,
    common_change,
    evened,
    scatter_of_cells,
    uneven_change,
)
from gelpolight_core.light.judging import (
    DARK,
    bad_pixel_findings,
    blur_finding,
    corrected,
    dirt_finding,
    far_moved_finding,
    fault,
    led_off_findings,
    light_findings,
    light_gain,
    may_have_moved,
    moved_finding,
    saturated_finding,
    uneven_finding,
    with_shape,
)
from gelpolight_core.light.movement import FOLLOWED_PX, movement_px
from gelpolight_core.light.pressed import is_pressed, press_effects
from gelpolight_core.light.samples import (
    PARAMETERS,
    SHIFT_U,
    SHIFT_V,
    Samples,
    compare_samples,
    samples_of,
)
from gelpolight_core.light.usual import ANY_LIGHT, Usual
from gelpolight_core.masks import SATURATED
from gelpolight_core.sensor_calibration import SensorModel

LEAST_UNTOUCHED = 0.12
"""Share of the field that must look as at calibration; otherwise all faults are unknown."""
BOUNDARY_CHANGE = 0.02
"""Alternatively, most of the boundary must have at most this change of light: a contact covers the
rest."""
UNJUDGED = tuple(key for key in KEYS if key not in ("other_sensor", "colour_order", "dark"))
STRIPE_ROWS = 12
"""Rows of each frame that are searched for bad pixels; each frame uses other rows."""


class HealthCheck:
    """Checks frames of one sensor against the background of its calibration.

    Several threads can call it; they then wait for each other.

    Parameters
    ----------
    calibration : SensorModel
        The sensor's.
    usual : Usual, optional
        How healthy presses change the light; by default in any way.
    crosstalk : (3, 3), optional
        Of the LEDs in the channels; by default none.
    leds_mm : (3, 3), optional
        Positions of the LEDs; without them, a press of the whole field is not told from other
        light.
    """

    def __init__(
        self,
        calibration: SensorModel,
        usual: Usual = ANY_LIGHT,
        *,
        crosstalk: NDArray[np.float64] | None = None,
        leds_mm: NDArray[np.float64] | None = None,
    ) -> None:
        self.calibration = calibration
        self.samples: Samples = samples_of(calibration)
        cells, runs = self.samples.count.size, self.samples.run_cell.size
        self._change = np.zeros((cells, PARAMETERS))
        self._square, self._full = np.zeros(cells), np.zeros(cells)
        self._run_change = np.zeros((3, runs))
        self._levels = LightLevels(calibration.response)
        self._usual = usual
        mixing = np.eye(3) if crosstalk is None else crosstalk
        self._unmix = np.asarray(np.linalg.inv(mixing), np.float64)
        self._press = None if leds_mm is None else press_effects(self.samples, leds_mm, self._unmix)
        self._noise = float(calibration.noise.max())
        self._stripe = 0
        self._lock = Lock()

    def check(self, frame: NDArray[Any], *, whole: bool = False) -> Health:
        """Return the faults of a frame, with or without an object pressed in.

        Parameters
        ----------
        frame : (height, width, 3) uint8, uint16 or float32
            RGB; whole numbers as the camera encodes them, floats linear light 0..1.
        whole : bool, optional
            Whether to search all rows for bad pixels, and to follow large movements of the camera;
            some tens of milliseconds. By default one stripe of rows is searched, another one for
            each frame.
        """
        if not self.samples.count.size:
            return Health(unknown=("other_sensor",), untouched=0.0)
        with self._lock:
            raw, light = self._coded(frame)
            pixels = self._bad_pixels(raw, light, whole)
            bad = isolated_pixels(raw, light, noise=self._noise) if pixels else None
            raw = raw if bad is None else bad.left_out(raw)
            return replace(self._judged(raw, light, whole, pixels), bad=bad)

    def _judged(self, raw: NDArray[Any], light: Map, whole: bool, pixels: list[Finding]) -> Health:
        """Return the findings on a frame without its bad pixels, of which `pixels` tell."""
        common = self._common(raw, light)
        if common.share >= LEAST_UNTOUCHED:
            return self._faults(raw, light, common, whole, pixels)
        far = [finding for finding in pixels if finding.meaningless]
        if far or self._boundary_fits():
            return health_of(far or pixels, unknown=UNJUDGED, untouched=common.share)
        if self._is_pressed(common):
            return self._all_pressed(pixels)
        return self._strange(raw, light, common.share, whole)

    def change(self, frame: NDArray[Any]) -> tuple[CommonChange, Uneven | None]:
        """Return the common change of a frame's light, and its uneven one."""
        with self._lock:
            common = self._common(*self._coded(frame))
            return common, uneven_change(self.samples, self._change, common)

    def light(self, frame: NDArray[Any]) -> Array:
        """Return the change of the light (cells, 3) of each part of the field, as a share."""
        with self._lock:
            self._common(*self._coded(frame))
            return self._cell_light()

    def movement(self, frame: NDArray[Any], most_sd: float) -> tuple[float, float] | None:
        """Return how far the membrane has moved in the image, px; None if it is not known."""
        with self._lock:
            raw, light = self._coded(frame)
            sd = self._common(raw, light).sd[[SHIFT_U, SHIFT_V]]
            # As it looks in the light at calibration.
            gain = np.maximum(1.0 + np.median(self._cell_light(), axis=0), DARK)
            same = (light / gain[:, None]).astype(np.float32)
            return movement_px(self.samples, raw, same) if np.hypot(*sd) < most_sd else None

    def _cell_light(self) -> Array:
        return self._change[:, :6:2] / self.samples.by_gain

    def _faults(
        self,
        raw: NDArray[Any],
        light: Map,
        common: CommonChange,
        whole: bool,
        pixels: list[Finding],
    ) -> Health:
        """Return the changes on the membrane of this sensor."""
        usual, samples = self._usual, self.samples
        uneven = uneven_change(samples, self._change, common)
        shaded = uneven_finding(usual.uneven(uneven))
        if uneven is not None and shaded is not None:
            less = evened(samples, self._change, self._square, uneven.shape)
            common = common_change(samples, *less, self._full)
        if (common.values[:6:2] < DARK - 1.0).all():
            return health_of(led_off_findings(1.0 + common.values[:6:2]), untouched=common.share)
        full = float(self._full.sum() / samples.count.sum())
        judged = usual.common(common)
        follow = whole and may_have_moved(judged)
        seen_px = movement_px(samples, raw, light) if follow else None
        moved = moved_finding(judged, seen_px)
        changes = light_findings(judged, 1.0 / np.iinfo(raw.dtype).max)
        gain = light_gain(judged, changes)
        if usual.corrected:
            gain = LightGain(1.0 + common.gain, scatter_of_cells(samples, common))
        if moved is not None and moved.value > FOLLOWED_PX:
            # The pattern of the light has moved, too.
            changes, gain = [finding for finding in changes if finding.meaningless], None
        elif uneven is not None and shaded is not None:
            changes.append(shaded)
            known = usual.corrected or not shaded.meaningless
            gain = with_shape(gain, common, uneven) if known else None
        if (changes or moved) and self._is_pressed(common):
            return self._all_pressed(pixels)
        if gain is not None:
            changes = [corrected(change) for change in changes]
        compressed = self._compressed(raw, light, common.untouched)
        # Lost detail looks like a movement and like blur.
        detail = compressed or moved
        blurred = None if detail else blur_finding(judged, samples.blur_strength)
        if blurred is not None and blurred.meaningless and common.share < LEAST_START:
            # The texture is missing.
            return health_of([fault("other_sensor", far=True)], untouched=common.share)
        # Specks that have moved or become weaker are not dirt, nor is a bad line.
        specks = detail or blurred or any(finding.key == "bad_line" for finding in pixels)
        found = [
            *changes,
            detail,
            blurred,
            saturated_finding(full, 1.0 - common.share),
            None if specks else dirt_finding(samples, self._run_change, common, self._unmix),
            *pixels,
        ]
        shown_by = {"compressed": self.calibration.grain, "blurred": samples.blur_strength.size}
        unknown = tuple(key for key, by in shown_by.items() if not by)
        return health_of(
            [f for f in found if f],
            unknown=unknown,
            untouched=common.share,
            cells=common.change,
            light=gain,
        )

    def _compressed(self, raw: NDArray[Any], light: Map, untouched: Mask) -> Finding | None:
        """Return that the image has lost detail; of pressed parts only its blocks tell that."""
        grain, blocks = self.calibration.grain, self.samples.blocks
        if grain is None or not blocks.size:
            return None
        if untouched.any():
            seen, step = block_grain(raw, light, blocks[untouched]), light[:, -1] - light[:, -2]
            lost = max(grain.in_blocks(seen), grain.lost(seen, float(step.max())))
        else:
            lost = grain.in_blocks(block_grain(raw, light, blocks))
        return fault("compressed", lost, far=not untouched.any()) if lost > 1.0 else None

    def _is_pressed(self, common: CommonChange) -> bool:
        """Return whether a press of the whole field explains a frame better than its light."""
        if self._press is None:
            return False
        change, usable = self._cell_light(), self._full == 0.0
        return is_pressed(self.samples, self._press, change, usable, common.change)

    def _all_pressed(self, pixels: list[Finding]) -> Health:
        return health_of([fault("all_pressed"), *pixels], unknown=UNJUDGED, untouched=0.0)

    def _boundary_fits(self) -> bool:
        """Return whether the boundary looks as at calibration, where a contact covers the rest."""
        s = self.samples
        at_boundary = (s.beside == np.arange(s.count.size)[:, None]).any(axis=1) & (
            self._full == 0.0
        )
        change = np.abs(self._cell_light()[at_boundary]).max(axis=1)
        return bool(change.size and np.median(change) < BOUNDARY_CHANGE)

    def _strange(self, raw: NDArray[Any], light: Map, share: float, whole: bool) -> Health:
        """Return why an image does not look like this sensor's membrane."""
        saturated = saturated_finding(float(self._full.sum() / self.samples.count.sum()))
        if saturated is not None and saturated.meaningless:
            return health_of([saturated], untouched=share)
        seen = 1.0 + self._run_change.sum(axis=1) / self.samples.run_light.sum(axis=1)
        if off := led_off_findings(seen):
            return health_of(off, untouched=share)
        for order in permutations(range(3)):
            turned = self._common(np.ascontiguousarray(raw[..., order]), light[list(order)])
            if turned.share > LEAST_START:
                letters = "".join("RGB"[k] for k in order)
                swapped = fault("colour_order", far=True, letters=letters)
                return health_of([swapped], untouched=share)
        compressed = self._compressed(raw, light, np.zeros(self.samples.count.size, np.bool_))
        if compressed is not None:
            return health_of([compressed], untouched=share)
        seen_px = movement_px(self.samples, raw, light) if whole else None
        far = fault("other_sensor", far=True) if seen_px is None else far_moved_finding(seen_px)
        return health_of([far], untouched=share)

    def _common(self, raw: NDArray[Any], light: Map) -> CommonChange:
        s = self.samples
        known = s.corner, s.part, s.run_cell, s.expected, s.effects, s.weight
        sums = self._change, self._square, self._full, self._run_change
        compare_samples(raw, light, np.float32(SATURATED), *known, *sums)
        return common_change(s, self._change, self._square, self._full)

    def _bad_pixels(self, raw: NDArray[Any], light: Map, whole: bool) -> list[Finding]:
        height = raw.shape[0]
        if min(raw.shape[:2]) < 8:
            return []
        step = 1 if whole else max(height // STRIPE_ROWS, 1)
        self._stripe = (self._stripe + 1) % step
        rows = np.arange(0 if whole else self._stripe, height, step)
        marks = differing(raw, light, rows, noise=self._noise)
        single = int(np.count_nonzero(marks == (ACROSS | DOWN)))
        columns, lines = bad_lines(marks, ACROSS), rows[bad_lines(marks.T, DOWN)]
        return bad_pixel_findings(single / marks.size, single, columns.tolist(), lines.tolist())

    def _coded(self, frame: NDArray[Any]) -> tuple[NDArray[Any], Map]:
        """Return a frame as integers, and the linear light of each value."""
        raw, linear = coded(frame)
        return raw, self._levels(raw.dtype, linear)
