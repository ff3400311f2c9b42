"""One-click calibration of the virtual sensor, so that new users see depth at once."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from app.context.context import AppContext
from app.services.jobs import Job, Jobs
from app.workspace.workspace import Workspace
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.translation import tr

# Measured: making the images takes about a third of the time.
IMAGES_SHARE = 0.35


def begin_first_calibration(jobs: Jobs, *, context: AppContext) -> None:
    """Calibrate the virtual sensor in the background if it is the camera."""
    bench, workspace = context.source.bench, context.workspace
    if bench is None or jobs.busy:
        return

    def done(_path: Path) -> None:
        context.toasts.show(tr("The virtual sensor is calibrated."))
        context.requests.calibrations_changed.emit()

    jobs.submit(
        Job(
            tr("Calibrating the virtual sensor"),
            lambda progress: calibrate_virtual_sensor(bench.design, workspace, progress),
            done,
        )
    )


def calibrate_virtual_sensor(
    design: SensorDesign, workspace: Workspace, progress: Callable[[float], None]
) -> Path:
    """Make a session of the virtual sensor, calibrate from it and put the result into use.

    Parameters
    ----------
    design : SensorDesign
        Design of the sensor on the bench.
    workspace : Workspace
        Stores the session and the calibration.
    progress : callable
        Called with the progress (0 to 1). An exception from it stops the work; nothing is kept.

    Returns
    -------
    path : Path
        The calibration.
    """
    from gelpolight_core.calibration.project import calibrate
    from gelpolight_core.session.session import read_session
    from gelpolight_core.simulation.session import simulate_session

    name = f"virtual-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}"
    sessions = workspace.sessions_folder(design.serial)
    # A folder name with a dot is not a session yet, so the library does not show it.
    folder, whole = sessions / f".{name}", sessions / name
    make_folder(folder)
    try:
        simulate_session(
            design, folder, progress=lambda _file, share: progress(IMAGES_SHARE * share)
        )
        # The calibration stores the session's name.
        folder.rename(whole)
        run = calibrate(
            read_session(whole),
            progress=lambda _stage, share: progress(IMAGES_SHARE + (1.0 - IMAGES_SHARE) * share),
        )
        path = workspace.keep_calibration(run.calibration, name)
    except BaseException:
        for unfinished in (folder, whole):
            shutil.rmtree(unfinished, ignore_errors=True)
        raise
    workspace.use(path)
    return path
