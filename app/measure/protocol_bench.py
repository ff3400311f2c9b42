"""The virtual bench makes the presses of the protocol."""

from __future__ import annotations

from app.sources.bench import Bench
from gelpolight_core.experiments.press_workers import placed_by_hand
from gelpolight_core.measurement.protocol import PressWanted


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
        x_mm, y_mm, yaw_deg = placed_by_hand(wanted, self._bench.seed)
        self._bench.lay(wanted.truth.shape)
        self._bench.arrange(
            size_mm=wanted.truth.size_mm,
            depth_mm=wanted.truth.height_mm,
            x_mm=x_mm,
            y_mm=y_mm,
            yaw_deg=yaw_deg,
        )
