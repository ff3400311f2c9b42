"""A sensor with a curved membrane that is stated to be flat."""

from gelpolight_core.calibration.project import calibrate
from gelpolight_core.finding import Verdict
from gelpolight_core.session.session import read_session
from tests.calibration.test_curved_session import as_stated


def test_a_cap_that_is_stated_flat_fails_with_its_height(tmp_path, curved_session):
    text = (curved_session / "session.toml").read_text()
    flat = text.replace("apex_height_mm = 2.0", "apex_height_mm = 0.0")
    run = calibrate(read_session(as_stated(curved_session, tmp_path, flat)))
    found = run.calibration.quality["joint"]["membrane_height_mm"]
    assert found.verdict is Verdict.FAIL
    assert found.value > 1.0
