"""Many presses of real closed sensors, where their images are beside the project."""

from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core import Measurement, measure, read_image
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import run_calibration
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from tests.calibration.closed_sensor.test_real_sensors import real_session


@pytest.mark.parametrize("name", ["mini-1", "wedge-1"])
def test_diameters_of_presses_left_out_are_within_their_deviations(shared_data, name):
    """The stated deviation was 2.5 times the scatter."""
    session = real_session(shared_data, name)
    files = session.files("balls")
    excluded = frozenset(f"balls/{path.name}" for path in files[::2])
    training = replace(session, decisions=replace(session.decisions, excluded=excluded))
    reconstructor = Reconstructor(run_calibration(training).calibration)
    error, sd = [], []
    for path in files[::2]:
        try:
            found = measure(reconstructor.depth(read_image(path), uncertainty=True), shape="ball")
        except InputError:
            continue  # cut by the border
        if found.verdict == "ok":
            error.append(found.diameter_mm - 2.0 * session.ball_radius_mm(path.name))
            sd.append(found.sd["diameter_mm"])
    assert len(error) >= 15
    assert (np.abs(error) < 3.0 * np.array(sd)).all()
    assert np.median(sd) < 2.0 * np.sqrt(np.mean(np.square(error)))


def test_another_exposure_of_a_gelsight_mini_changes_no_size(shared_data):
    """x0.95 read 11.6 for 12.7 mm and ok, x1.05 no object at all."""
    session = real_session(shared_data, "mini-1")
    names = ("ball_03.png", "ball_20.png", "ball_40.png")
    # Every third ball, and none of those that are measured.
    excluded = {
        f"balls/{path.name}"
        for n, path in enumerate(session.files("balls"))
        if n % 3 or path.name in names
    }
    training = replace(session, decisions=replace(session.decisions, excluded=frozenset(excluded)))
    reconstructor = Reconstructor(run_calibration(training).calibration)
    for name in names:
        image = read_image(session.folder / "balls" / name)

        def exposed(gain: float, image: np.ndarray = image) -> Measurement:
            frame = np.clip(np.rint(gain * image.astype(float)), 0, 255).astype(np.uint8)
            height_map = reconstructor.depth(frame, uncertainty=True)
            stated = any(note.key == "exposure" for note in height_map.findings)
            assert stated or gain == 1.0
            return measure(height_map, shape="ball")

        alone = exposed(1.0)
        for gain in (0.8, 0.95, 1.05, 1.1):
            found = exposed(gain)
            assert found.verdict == alone.verdict
            assert found.diameter_mm == pytest.approx(
                alone.diameter_mm, abs=0.2 * alone.sd["diameter_mm"]
            )
