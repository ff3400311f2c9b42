"""Counts the presses of the live gel, and keeps how fast it recovers from them."""

from __future__ import annotations

from PySide6.QtCore import QObject, QTimer

from app.context.context import AppContext
from app.context.gel_care_text import care_lines, recovery_text
from app.workspace.gel_care import GelCare, read_gel_care, write_gel_care
from gelpolight_core.errors import InputError
from gelpolight_core.health.watch import Gel
from gelpolight_core.translation import tr

KEEP_MS = 5_000
"""Delay from a press to its writing into the workspace."""


class GelCareLog(QObject):
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
        self._seen = Gel()
        self._new: dict[str, GelCare] = {}
        self._kept: dict[str, GelCare] = {}
        self._keep = QTimer(self)
        self._keep.setSingleShot(True)
        self._keep.setInterval(KEEP_MS)
        self._keep.timeout.connect(self.flush)
        self._reported = False
        context.requests.calibrations_changed.connect(self._read)
        self._read()

    def restart(self) -> None:
        """Follow another health watch from now on: the source, or what is shown, is another."""
        self._seen = Gel()
        self.flush()

    def follow(self, identity: str, gel: Gel) -> None:
        """Take in what the watch has seen, with the calibration of this identity."""
        before, self._seen = self._seen, gel
        presses = gel.presses - before.presses
        ended = gel.recovery_s is not None and (presses > 0 or before.recovery_s is None)
        if presses <= 0 and not ended:
            return
        times = (gel.recovery_s,) if ended and gel.recovery_s is not None else ()
        self._new[identity] = self._new.get(identity, GelCare()).later(max(presses, 0), times)
        self._keep.start()

    def lines(self, identity: str) -> tuple[str, ...]:
        """Return the use of the gel since this calibration, and the last recovery."""
        new = self._new.get(identity, GelCare())
        care = self._kept.get(identity, GelCare()).later(new.presses, new.last_s)
        if not care.presses:
            return ()
        last = self._seen.recovery_s
        now = () if last is None else (
            tr("Recovery after the last press: {time}").format(time=recovery_text(last)),
        )  # fmt: skip
        return (*care_lines(care), *now)

    def flush(self) -> None:
        """Write the new presses into the workspace."""
        self._keep.stop()
        if not self._new:
            return
        folder = self._context.workspace.folder
        try:
            care = read_gel_care(folder)
            for identity, new in self._new.items():
                care[identity] = care.get(identity, GelCare()).later(new.presses, new.last_s)
            write_gel_care(care, folder)
        except InputError as error:
            self._report(error)
            return
        self._new, self._kept = {}, care

    def _read(self) -> None:
        try:
            self._kept = read_gel_care(self._context.workspace.folder)
        except InputError as error:
            self._report(error)

    def _report(self, error: InputError) -> None:
        """Show an error once: it may come with every press."""
        if not self._reported:
            self._context.toasts.show(str(error), "warn")
        self._reported = True
