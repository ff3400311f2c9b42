"""The virtual bench makes the presses of the protocol."""

from __future__ import annotations

import numpy as np

from app.sources.bench import Bench
from gelpolight_core.measurement.protocol import PressWanted

HAND_MM, HAND_DEG = 0.1, 1.0
"""Repeatability of placing by hand, one standard deviation."""


class BenchHand:
    """Places on the bench what the protocol requests.

    Parameters
    ----------
    bench : Bench
        Of the virtual sensor.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._laid: PressWanted | None = None

    def lift(self) -> None:
        """Remove everything from the sensor."""
        self._laid = None
        if self._bench.scene.item != "bare":
            self._bench.lay("bare")

    def press(self, wanted: PressWanted) -> None:
        """Press an object in, once."""
        if wanted == self._laid:
            return
        self._laid = wanted
        rng = np.random.default_rng([self._bench.seed, *wanted.file.encode()])
        dx_mm, dy_mm, turn_deg = rng.standard_normal(3) * (HAND_MM, HAND_MM, HAND_DEG)
        x_mm, y_mm = wanted.position_mm
        self._bench.lay(wanted.truth.shape)
        self._bench.arrange(
            size_mm=wanted.truth.size_mm,
            depth_mm=wanted.truth.height_mm,
            x_mm=x_mm + dx_mm,
            y_mm=y_mm + dy_mm,
            yaw_deg=wanted.yaw_deg + turn_deg,
        )
