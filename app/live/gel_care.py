"""Counts the presses of the live gel since each calibration."""

from __future__ import annotations

from collections import Counter

from PySide6.QtCore import QObject, QTimer

from app.context.context import AppContext
from app.workspace.gel_care import presses_text, read_presses, write_presses
from gelpolight_core.errors import InputError

KEEP_MS = 5_000
"""Delay from a press to its writing into the workspace."""


class PressCounter(QObject):
    """Follows the presses that the health watch of a live page sees.

    Parameters
    ----------
    parent : QObject
        The owner.
    context : AppContext
        Holds the workspace.
    """

    def __init__(self, parent: QObject, *, context: AppContext) -> None:
        super().__init__(parent)
        self._context = context
        self._seen = 0
        self._new, self._kept = Counter[str](), Counter[str]()
        self._keep = QTimer(self, singleShot=True, interval=KEEP_MS)
        self._keep.timeout.connect(self.flush)
        self._reported = False
        context.requests.calibrations_changed.connect(self._read)
        self._read()

    def restart(self) -> None:
        """Follow another health watch from now on: the source, or what is shown, is another."""
        self._seen = 0
        self.flush()

    def follow(self, identity: str, presses: int) -> None:
        """Note the presses that the watch has seen, with the calibration of this identity."""
        before, self._seen = self._seen, presses
        if presses > before:
            self._new[identity] += presses - before
            self._keep.start()

    def lines(self, identity: str) -> tuple[str, ...]:
        """Return the presses since this calibration."""
        presses = self._kept[identity] + self._new[identity]
        return (presses_text(presses),) if presses else ()

    def flush(self) -> None:
        """Write the new presses into the workspace."""
        self._keep.stop()
        if not self._new:
            return
        folder = self._context.workspace.folder
        try:
            presses = Counter(read_presses(folder)) + self._new
            write_presses(presses, folder)
        except InputError as error:
            self._report(error)
            return
        self._new, self._kept = Counter(), presses

    def _read(self) -> None:
        try:
            self._kept = Counter(read_presses(self._context.workspace.folder))
        except InputError as error:
            self._report(error)

    def _report(self, error: InputError) -> None:
        """Show an error once: it may come with every press."""
        if not self._reported:
            self._context.toasts.show(str(error), "warn")
        self._reported = True
