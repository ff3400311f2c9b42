"""Check that a recording and a calibration belong together."""

from __future__ import annotations

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.linear_image import require_size
from gelpolight_core.sensor.sensor_calibration import Calibration

from .recording_reader import Recording


def require_match(recording: Recording, calibration: Calibration) -> None:
    """Refuse a calibration of another sensor, or for another image size.

    A recording without a sensor name matches any calibration; which calibration of a sensor was in
    use during recording does not matter.

    Parameters
    ----------
    recording : Recording
        Open recording.
    calibration : Calibration
        The calibration for its reconstruction.

    Raises
    ------
    InputError
        If they do not belong together.
    """
    recorded, calibrated = recording.header.serial, calibration.serial
    if recorded and recorded != calibrated:
        text = (
            f"The recording is of sensor {recorded}, but the calibration is of sensor {calibrated}"
        )
        raise InputError(text, recording.path, Remedy.SAME_SENSOR)
    if len(recording):
        camera = calibration.camera
        require_size(recording.size, (camera.width, camera.height), where=str(recording.path))


def recording_notes(recording: Recording) -> list[str]:
    """Return notes for the user about an incomplete recording."""
    notes = []
    if recording.truncated:
        notes.append("The recording is truncated or damaged; only the readable part is used")
    if recording.lost:
        notes.append(f"{recording.lost} frames of the source are missing in the recording")
    return notes
