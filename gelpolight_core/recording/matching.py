"""Whether a recording and a calibration belong together, and what is to be said of it."""

from __future__ import annotations

from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.recording.reader import Recording
from gelpolight_core.translation import tr


def require_match(recording: Recording, calibration: Calibration) -> None:
    """Refuse a calibration of another sensor, or of pictures of another size.

    A recording that names no sensor goes with any; which of a sensor's calibrations was in use
    when it was recorded does not matter.

    Parameters
    ----------
    recording : Recording
        An open one.
    calibration : Calibration
        That it shall be reconstructed with.

    Raises
    ------
    InputError
        If they do not belong together.
    """
    recorded, calibrated = recording.header.serial, calibration.sensor.serial
    if recorded and recorded != calibrated:
        raise InputError(
            tr("the recording is of sensor {a} and the calibration of sensor {b}").format(
                a=recorded, b=calibrated
            ),
            where=str(recording.path),
            advice=tr("Choose a calibration of sensor {a}").format(a=recorded),
        )
    size = (calibration.camera.width, calibration.camera.height)
    if len(recording) and recording.size != size:
        raise InputError(
            tr("the frames are {a} pixels and the calibration is for {b}").format(
                a="x".join(map(str, recording.size)), b="x".join(map(str, size))
            ),
            where=str(recording.path),
            advice=tr("Choose a calibration for frames of this size"),
        )


def recording_notes(recording: Recording) -> list[str]:
    """Return what a person should know of a recording that is not all that it could be."""
    notes = []
    if recording.truncated:
        notes.append(tr("the recording was cut short or is damaged; this is what is left of it"))
    if recording.lost:
        notes.append(
            tr("{n} frames of the source are not in the recording").format(n=recording.lost)
        )
    return notes
