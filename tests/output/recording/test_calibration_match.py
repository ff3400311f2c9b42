"""A recording matches only calibrations of its own sensor."""

import pytest
import scene
from recorded import write_recording

from gelpolight_core.base.errors import InputError
from gelpolight_core.output.recording.calibration_match import require_match
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording


@pytest.mark.parametrize("named", [True, False])
def test_another_calibration_of_the_same_sensor_will_do(tmp_path, named):
    calibration = scene.calibration()
    serial = calibration.serial if named else ""
    header = RecordingHeader(serial=serial, calibration_id="an older one")
    shape = (calibration.camera.height, calibration.camera.width)
    write_recording(tmp_path / "a.gplrec", frames=1, shape=shape, header=header)
    with Recording.open(tmp_path / "a.gplrec") as recording:
        require_match(recording, calibration)


def test_another_sensor_or_size_is_refused_by_name(tmp_path):
    calibration = scene.calibration()
    write_recording(tmp_path / "a.gplrec", header=RecordingHeader(serial="other"))
    with Recording.open(tmp_path / "a.gplrec") as recording:
        with pytest.raises(
            InputError, match="is of sensor other, but the calibration is of sensor"
        ):
            require_match(recording, calibration)
    write_recording(tmp_path / "b.gplrec", shape=(5, 7))
    with Recording.open(tmp_path / "b.gplrec") as recording:
        with pytest.raises(InputError, match="has 7x5 pixels instead of"):
            require_match(recording, calibration)
