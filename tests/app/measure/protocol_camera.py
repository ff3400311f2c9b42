"""A camera on the small sensor of the scene: bare, or with an object pressed in."""

import threading
import time

import numpy as np
import scene
from numpy.typing import NDArray

from app.sources.source import Frame, Setting
from gelpolight_core.sensor_calibration import Calibration

RATE_HZ = 60.0
NOISES = 29  # more than a press and its bare images together
WALL_MM = 0.25


def image(
    calibration: Calibration, position_mm: tuple[float, float] | None, size_mm: float = 5.0
) -> NDArray[np.float64]:
    """Return the camera image (240, 320, 3), 0..1, of a round press 0.5 mm high, or of none."""

    def slopes(points: NDArray[np.float64]) -> NDArray[np.float64]:
        if position_mm is None:
            return np.zeros_like(points)
        away = points - np.array(position_mm)
        radius = np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9)
        fall = 0.25 / WALL_MM / np.cosh((radius - 0.5 * size_mm) / WALL_MM) ** 2
        return np.asarray(-fall * away / radius)

    return np.asarray(scene.raw_image(slopes, calibration), np.float64)


class SceneCamera:
    """Shows what a test places before it. Each frame has its own noise."""

    kind, name, size = "camera", "Scene camera", (320, 240)

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._lock = threading.Lock()
        self._light = image(calibration, None)
        self.made = 0
        random = np.random.default_rng(0)
        shape = (NOISES, *self._light.shape)
        self._noise = random.standard_normal(shape, dtype=np.float32)
        self.shaking = self.cropped = False

    def press(self, position_mm: tuple[float, float] | None) -> None:
        """Press at a point from the next frame on. None: lift."""
        light = image(self._calibration, position_mm)
        with self._lock:
            self._light = light

    def open(self) -> None:
        """Do nothing."""

    def frame(self, timeout_s: float) -> Frame | None:
        """Return the next frame."""
        time.sleep(min(1.0 / RATE_HZ, timeout_s))
        with self._lock:
            light, self.made = self._light, self.made + 1
            if self.shaking:
                # Random: otherwise a regular movement could look still to a check of every fifth
                # frame.
                away = np.random.default_rng(self.made).integers(0, 5, 2)
                light = np.roll(light, away, axis=(1, 0))
            value = 255.0 * light + self._noise[self.made % NOISES]
            if self.cropped:
                value = value[:, ::2]
        return Frame(np.clip(np.rint(value), 0, 255).astype(np.uint8), self.made, time.monotonic())

    def settings(self) -> tuple[Setting, ...]:
        """Return none."""
        return ()

    def close(self) -> None:
        """Do nothing."""
