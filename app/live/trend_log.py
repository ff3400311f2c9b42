"""What live images of the untouched membrane say of the sensor, kept for its trend."""

from __future__ import annotations

from datetime import UTC, datetime

from PySide6.QtCore import QObject

from app.context.context import AppContext
from app.widgets.timers import timer
from gelpolight_core.errors import InputError
from gelpolight_core.lab.trend import drifting, keep_sample, read_samples, sample_of_frames
from gelpolight_core.light.finding import StateChange

KEEP_MS = 3_600_000
"""Values are kept every hour, and at the end."""


class TrendLog(QObject):
    """Collects the changes of a sensor, and reports a drift once.

    Parameters
    ----------
    parent : QObject
        The owner.
    context : AppContext
        Holds the workspace, and shows messages.
    """

    def __init__(self, parent: QObject, *, context: AppContext) -> None:
        super().__init__(parent)
        self._context = context
        self._of = "", ""
        self._changes: list[StateChange] = []
        self._reported: set[tuple[str, str]] = set()
        self._keep = timer(self, KEEP_MS, self.flush, once=True)

    def follow(self, serial: str, calibration: str, change: StateChange) -> None:
        """Add what a frame shows of a sensor, with the identity of its calibration."""
        if self._of != (serial, calibration):
            self.flush()
            self._of = serial, calibration
        self._changes.append(change)
        if not self._keep.isActive():
            self._keep.start()

    def flush(self) -> None:
        """Write the mean of the frames into the sensor's folder, and report a drift."""
        self._keep.stop()
        changes, self._changes = self._changes, []
        if not changes:
            return
        serial, calibration = self._of
        folder = self._context.workspace.sensor_folder(serial)
        try:
            keep_sample(sample_of_frames(changes, calibration, datetime.now(UTC)), folder)
            found = drifting(
                read_samples(folder), calibration, self._context.settings.limits.percent
            )
        except InputError as error:
            self._report((serial, ""), str(error))
            return
        for finding in found:
            self._report((calibration, finding.key), f"{serial}: {finding.line}")

    def _report(self, what: tuple[str, str], text: str) -> None:
        """Show a message once: it may come every hour."""
        if what not in self._reported:
            self._reported.add(what)
            self._context.toasts.show(text, "warn")
