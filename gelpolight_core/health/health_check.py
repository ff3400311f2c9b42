"""The health check of a frame: sample the image, fit the light, find faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array
from gelpolight_core.image.bad_pixels import (
    ACROSS,
    DOWN,
    BadPixels,
    bad_lines,
    differing_pixels,
    isolated_pixels,
    threads_of,
)
from gelpolight_core.image.coded import LightLevels, coded

from .background_reference import BackgroundReference
from .fault_limits import DARK
from .faults import judge_frame
from .frame_evidence import BadPixelCount, FrameEvidence, HealthReference
from .frame_health import FrameHealth
from .global_change import GlobalChange
from .health_samples import SHIFT_U, SHIFT_V
from .movement import search_movement
from .press_scatter import ANY_LIGHT, HealthyPressScatter

STRIPE_ROWS = 12
"""Rows of each frame that are searched for bad pixels; each frame uses other rows."""


class HealthCheck:
    """Checks frames of one sensor against the background of its calibration.

    Several threads can call it; they then wait for each other.

    Parameters
    ----------
    calibration : BackgroundReference
        The sensor.
    usual : HealthyPressScatter, optional
        How healthy presses change the light; by default in any way.
    crosstalk : (3, 3), optional
        Response of the channels to the LEDs; by default none.
    leds_mm : (3, 3), optional
        Positions of the LEDs; without them, a press of the whole field is not distinguished
        from other light.
    """

    def __init__(
        self,
        calibration: BackgroundReference,
        usual: HealthyPressScatter = ANY_LIGHT,
        *,
        crosstalk: NDArray[np.float64] | None = None,
        leds_mm: NDArray[np.float64] | None = None,
    ) -> None:
        mixing = np.eye(3) if crosstalk is None else crosstalk
        self._reference = HealthReference(calibration, usual, mixing, leds_mm)
        self.samples = self._reference.samples
        self._levels = LightLevels(calibration.response)
        self._noise = float(calibration.noise.max())
        self._stripe = 0
        self._lock = Lock()

    def check(self, frame: NDArray[Any], *, whole: bool = False) -> FrameHealth:
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
            return FrameHealth(unknown=("other_sensor",), untouched=0.0)
        with self._lock:
            raw, light = self._coded(frame)
            pixels, bad = self._bad_pixels(raw, light, whole)
            raw = raw if bad is None else bad.fill_bad_pixels(raw)
            evidence = FrameEvidence(self._reference, raw, light, whole=whole, bad_pixels=pixels)
            return replace(judge_frame(evidence), bad=bad)

    def check_repaired(self, frame: NDArray[Any]) -> FrameHealth:
        """Return the faults of a frame whose bad pixels are filled already."""
        if not self.samples.count.size:
            return FrameHealth(unknown=("other_sensor",), untouched=0.0)
        with self._lock:
            raw, light = self._coded(frame)
            none = BadPixelCount()
            return judge_frame(
                FrameEvidence(self._reference, raw, light, whole=False, bad_pixels=none)
            )

    def change(self, frame: NDArray[Any]) -> tuple[GlobalChange, Mapping[str, float]]:
        """Return the common change of a frame's light, and the evidence for explanations."""
        with self._lock:
            common = self._reference.compare(*self._coded(frame))
            return common, self._reference.model.evidence(self._reference.sums)

    def light(self, frame: NDArray[Any]) -> Float64Array:
        """Return the change of the light (cells, 3) of each part of the field, as a share."""
        with self._lock:
            self._reference.compare(*self._coded(frame))
            return self._reference.light

    def movement(self, frame: NDArray[Any], most_sd: float) -> tuple[float, float] | None:
        """Return the movement of the membrane in the image, px, or None if it is not known."""
        with self._lock:
            raw, light = self._coded(frame)
            sd = self._reference.compare(raw, light).sd[[SHIFT_U, SHIFT_V]]
            # As it looks in the light at calibration.
            gain = np.maximum(1.0 + np.median(self._reference.light, axis=0), DARK)
            same = (light / gain[:, None]).astype(np.float32)
            model = self._reference.model
            found = search_movement(model, raw, same) if np.hypot(*sd) < most_sd else None
            if found is None:
                return None
            u, v = found.px.mean(axis=0).tolist()
            return u, v

    def _bad_pixels(
        self, raw: NDArray[Any], light: Float32Array, whole: bool
    ) -> tuple[BadPixelCount, BadPixels | None]:
        """Return the count of the bad pixels, and all of them if there are any."""
        height = raw.shape[0]
        if min(raw.shape[:2]) < 8:
            return BadPixelCount(), None
        step = 1 if whole else max(height // STRIPE_ROWS, 1)
        self._stripe = (self._stripe + 1) % step
        rows = np.arange(0 if whole else self._stripe, height, step)
        marks = differing_pixels(raw, light, rows, noise=self._noise)
        columns, lines = bad_lines(marks, ACROSS), rows[bad_lines(marks.T, DOWN)]
        single = marks == (ACROSS | DOWN)

        def count(thread: tuple[int, int] | None = None) -> BadPixelCount:
            number = int(np.count_nonzero(single))
            found = tuple(columns.tolist()), tuple(lines.tolist())
            return BadPixelCount(number / single.size, number, *found, thread)

        pixels = count()
        if not pixels.any:
            return pixels, None
        bad = isolated_pixels(raw, light, noise=self._noise)
        threads = threads_of(bad, columns, lines)
        places = np.argwhere(threads)
        if not places.size:
            return pixels, bad
        single &= ~threads[rows]
        row, column = places[len(places) // 2].tolist()
        return count((column, row)), bad

    def _coded(self, frame: NDArray[Any]) -> tuple[NDArray[Any], Float32Array]:
        """Return a frame as integers, with the linear light of each value."""
        raw, linear = coded(frame)
        return raw, self._levels(raw.dtype, linear)
