"""The calibration in use, in the status bar."""

from __future__ import annotations

from app.context.context import AppContext
from app.workspace.entries import read_entry
from gelpolight_core.translation import tr


def show_in_use(context: AppContext) -> None:
    """Show the calibration in use in the status bar."""
    path = context.workspace.in_use
    if path is None:
        context.status.update(calibration=None, calibration_note="")
        return
    used = read_entry(path, in_use=True)
    note = tr("validated") if used.validated else tr("not validated")
    context.status.update(
        calibration=used.name,
        calibration_note=tr("broken") if used.broken else note,
    )
