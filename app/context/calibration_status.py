"""The calibration in use, in the status bar."""

from __future__ import annotations

from collections.abc import Iterable

from app.context.context import AppContext
from app.workspace.entries import Entry
from gelpolight_core.translation import tr


def show_in_use(context: AppContext, entries: Iterable[Entry]) -> None:
    """Show the calibration in use in the status bar."""
    used = next((entry for entry in entries if entry.in_use), None)
    if used is None:
        context.status.update(calibration=None, calibration_note="")
        return
    note = tr("validated") if used.validated else tr("not validated")
    context.status.update(
        calibration=used.name,
        calibration_note=tr("broken") if used.broken else note,
    )
