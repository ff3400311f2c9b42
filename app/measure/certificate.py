"""The certificate of a measured object, written in the background."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.services.jobs import Job, Jobs
from app.services.preferences import Limits
from gelpolight_core.measurement.measured_press import MeasuredPress
from gelpolight_core.sensor_calibration import Calibration


def certify(
    press: MeasuredPress,
    path: Path,
    calibration: Calibration,
    *,
    limits: Limits,
    operator: str,
    jobs: Jobs,
    done: Callable[[str], None],
) -> None:
    """Write the certificate of a measured object, then call `done` with a sentence.

    Parameters
    ----------
    press : MeasuredPress
        The object.
    path : Path
        The file.
    calibration : Calibration
        That it was measured with.
    limits : Limits
        Tolerances of the decisions.
    operator : str
        Who measured it.
    jobs : Jobs
        Also reports why it was not written.
    done : callable
        Called when the file is written.
    """

    def work(_progress: object) -> None:
        from gelpolight_core.report.file import write_report  # slow to import
        from gelpolight_core.report.measurement import measurement_report

        percent = limits.percent
        report = measurement_report(
            calibration, (press,), limits_percent=percent, operator=operator
        )
        write_report(report, path)

    saved = f"Certificate saved as {path}"
    jobs.submit(Job("Writing the certificate", work, lambda _nothing: done(saved)))
