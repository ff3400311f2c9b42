"""The calibration of the virtual sensor, so that new users see depth at once."""

from __future__ import annotations

from pathlib import Path

from app.context.context import AppContext
from app.prepare import prepare, prepared
from app.services.jobs import Job, Jobs


def use_virtual_calibration(jobs: Jobs, *, context: AppContext) -> None:
    """Put the calibration of the virtual sensor into use, unless one of it is in use.

    If this version has not made it yet, it is made in the background.
    """
    bench, workspace = context.source.bench, context.workspace
    if bench is None:
        return
    camera = bench.design.camera
    wanted = bench.design.serial, (camera.width_px, camera.height_px)
    with context.toasts.errors():
        used = next((e.summary for e in workspace.entries() if e.in_use), None)
        if used is not None and (used.serial, used.image_size) == wanted:
            return

    def use(path: Path) -> None:
        with context.toasts.errors():
            workspace.use(workspace.import_calibration(path))
        context.requests.calibrations_changed.emit()

    if (path := prepared()) is not None:
        use(path)
    else:
        jobs.submit(Job("Preparing the virtual sensor", prepare, use))
