"""The virtual sensor as a live source: the scene on the bench as its camera would deliver it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import fields
from functools import lru_cache
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import AnyFloatArray, Float32Array, PixelArray
from gelpolight_core.base.errors import Remedy
from gelpolight_core.simulation.exposure import blurred

from .rendering import RenderedScene, Renderer
from .source import SourceFrame, SourceLost, SourceSetting, source_closed_error
from .virtual_bench import BOARDS, NOMINAL_EXPOSURE_MS, BenchConditions, VirtualBench

FULL_SCALE = 255.0
"""Largest count of the virtual sensor's camera, which has 8 bits."""
ROOM_LIGHT = (0.066, 0.060, 0.050)
"""Light of a lit room in the three channels at the nominal exposure; 1 is full scale."""
TOO_BRIGHT = 3.0
"""Factor on the light of an overexposed image."""
DEFOCUS_OF_WIDTH = 0.012
"""Blur of a defocused lens (standard deviation) as a share of the image's width."""
DEAD_LED = 2
"""The LED that is switched off: the blue one."""
SPECKS, SPECK_OF_WIDTH, SPECK_LIGHT = 40, 0.004, 0.35
"""Number of dust specks, their mean radius as a share of the width, and the light that passes."""


def _without_led(signal: AnyFloatArray, crosstalk: AnyFloatArray) -> AnyFloatArray:
    """Return an image (..., 3) without the light of one LED, in all channels that see it."""
    leds_on = np.diag(np.arange(3) != DEAD_LED).astype(float)
    return np.asarray(signal @ (crosstalk @ leds_on @ np.linalg.inv(crosstalk)).T)


def _dust(shape: tuple[int, ...], seed: int) -> AnyFloatArray:
    """Return the share of light (rows, columns) that passes the dust."""
    random, (rows, columns) = np.random.default_rng(seed), shape
    clear = np.ones((rows, columns))
    radius = SPECK_OF_WIDTH * columns
    for x, y, size in random.uniform((0, 0, 0.5), (columns, rows, 1.5), (SPECKS, 3)):
        centre, radius_px = (round(x), round(y)), max(round(size * radius), 1)
        cv2.circle(clear, centre, radius_px, SPECK_LIGHT, cv2.FILLED)
    return clear


NOISE_STARTS = 2**20
"""Each image takes its noise from another of so many places: no two images have the same."""
_SETTINGS = ("exposure_ms", "gain_db", "rate_hz")
"""The conditions of the bench that a camera could set."""


_Exposed = tuple[RenderedScene, BenchConditions, Callable[[int], PixelArray]]
"""A rendering, the conditions of its exposure, and the function from a frame number to an image."""


class VirtualSource:
    """Frames of the scene on a bench, at the rate of a camera.

    While a new scene is being rendered, frames continue with ``settled`` False.

    Parameters
    ----------
    bench : VirtualBench
        May be changed at any time, by any thread.
    """

    kind = "virtual"

    def __init__(self, bench: VirtualBench) -> None:
        self.bench = bench
        self.name = f"Virtual sensor {bench.design.serial}"
        self._renderer: Renderer | None = None
        self._exposed: _Exposed | None = None
        self._closed = threading.Event()
        self._next_number, self._due_s = 0, math.nan
        self._noise_seed = 0

    def open(self) -> None:
        """Start to render. The first frame arrives when the first image is ready."""
        self._refuse_if_stopped(self.bench.conditions)
        if self._renderer is None:
            self._closed.clear()
            self._renderer = Renderer(self.bench)
            # As with a camera, no two captures are identical, however often it is opened.
            self._noise_seed = time.monotonic_ns()
            self._next_number, self._due_s = 0, math.nan

    def frame(self, timeout_s: float) -> SourceFrame | None:
        """Wait for the camera's next frame. None: none arrived in time."""
        limit_s = time.monotonic() + timeout_s
        renderer = self._renderer
        if renderer is None:
            raise source_closed_error(self.name)
        renderer.request(self.bench.seen)
        rendering = renderer.newest(timeout_s)
        if rendering is None or not self._wait_until_due(limit_s):
            return None
        # Before the scene is read: later changes are not in this frame.
        now = time.monotonic()
        conditions, scene = self.bench.conditions, self.bench.seen
        self._refuse_if_stopped(conditions)
        rendering = renderer.newest(0.0) or rendering
        # The time between frames is no shorter than the exposure.
        number = self._advance(max(1.0 / conditions.rate_hz, 1e-3 * conditions.exposure_ms))
        if self._exposed is None or self._exposed[:2] != (rendering, conditions):
            self._exposed = rendering, conditions, self._exposure(rendering, conditions)
        settled = rendering.scene == scene
        if settled:  # an object that moves by itself waits for its images
            self.bench.advance(now)
        return SourceFrame(self._exposed[2](number), number, now, settled)

    def settings(self) -> tuple[SourceSetting, ...]:
        """Return exposure, gain and frame rate."""
        settings = []
        for f in fields(BenchConditions):
            if f.name in _SETTINGS:
                meta, value = f.metadata, getattr(self.bench.conditions, f.name)
                (low, high), unit = meta["span"], meta["unit"].strip()
                setting = SourceSetting(f.name, meta["label"], unit, low, high, meta["step"], value)
                settings.append(setting)
        return tuple(settings)

    def close(self) -> None:
        """Stop rendering. An object that moves by itself stays where it is."""
        self._closed.set()
        self.bench.stop()
        if self._renderer is not None:
            self._renderer.stop()
        self._renderer, self._exposed = None, None

    def _refuse_if_stopped(self, conditions: BenchConditions) -> None:
        if "camera_stops" in conditions.faults:
            raise SourceLost("the camera has stopped", self.name, Remedy.CHECK_CABLE)

    def _wait_until_due(self, limit_s: float) -> bool:
        now = time.monotonic()
        if math.isnan(self._due_s):
            self._due_s = now
        wait_s = min(self._due_s, limit_s) - now
        if wait_s > 0.0:
            self._closed.wait(wait_s)
        return self._due_s <= limit_s and not self._closed.is_set()

    def _advance(self, period_s: float) -> int:
        """Return the number of the frame that is due. A late one delays the next ones."""
        self._due_s = max(self._due_s + period_s, time.monotonic())
        self._next_number += 1
        return self._next_number - 1

    def _exposure(
        self, rendering: RenderedScene, conditions: BenchConditions
    ) -> Callable[[int], PixelArray]:
        """Return the function from the number of a frame to its image, with noise of its own."""
        signal = _exposed_signal(rendering, conditions, self.bench)
        camera, seed = self.bench.design.camera, self._noise_seed
        if conditions.noise == 0.0:
            quiet = np.rint(FULL_SCALE * np.clip(signal, 0.0, 1.0)).astype(np.uint8)
            return lambda number: _rgb(quiet.copy())
        level = FULL_SCALE * np.maximum(signal, 0.0)
        # Light and read noise are amplified alike: with the gain g, a signal s has the variance
        # g shot_variance s + (g read_sd)^2.
        gain, scale = FULL_SCALE * _amplification(conditions), conditions.noise
        shot, read = gain * scale**2 * camera.shot_variance, (gain * scale * camera.read_sd) ** 2
        deviation = cv2.sqrt(cv2.addWeighted(level, shot, level, 0.0, read))
        noise = _standard_noise(level.size)
        change = np.empty_like(level)

        def make(number: int) -> PixelArray:
            start = np.random.default_rng(seed + number).integers(NOISE_STARTS)
            drawn = noise[start : start + level.size].reshape(level.shape)
            # Rounded, and within the range of the type.
            return _rgb(cv2.add(cv2.multiply(deviation, drawn, change), level, dtype=cv2.CV_8U))

        return make


@lru_cache(maxsize=1)
def _standard_noise(size: int) -> Float32Array:
    """Return normal noise. New numbers for thirty images a second would take too long."""
    return np.random.default_rng().standard_normal(size + NOISE_STARTS, dtype=np.float32)


def _rgb(counts: NDArray[Any]) -> PixelArray:
    """Return grey or colour counts as three channels."""
    return cast(PixelArray, np.dstack([counts] * 3) if counts.ndim == 2 else counts)


def _amplification(conditions: BenchConditions) -> float:
    return float(10.0 ** (conditions.gain_db / 20.0))


def _exposed_signal(
    rendering: RenderedScene, conditions: BenchConditions, bench: VirtualBench
) -> Float32Array:
    """Return the signal with faults, at the camera's exposure and gain. 1 is full scale."""
    signal: AnyFloatArray = rendering.signal
    if rendering.scene.item not in BOARDS:  # the LEDs and the room do not light a board
        if "led_off" in conditions.faults:
            signal = _without_led(signal, np.array(bench.design.photometry.crosstalk))
        if "room_light" in conditions.faults:
            signal = signal + np.array(ROOM_LIGHT)
    if "dust" in conditions.faults:
        clear = _dust(signal.shape[:2], bench.seed)
        signal = signal * (clear if signal.ndim == 2 else clear[..., None])
    if "defocused" in conditions.faults:
        signal = blurred(signal, DEFOCUS_OF_WIDTH * signal.shape[1])
    if "too_bright" in conditions.faults:
        signal = signal * TOO_BRIGHT
    factor = conditions.exposure_ms / NOMINAL_EXPOSURE_MS * _amplification(conditions)
    return np.asarray(signal * factor, np.float32)
