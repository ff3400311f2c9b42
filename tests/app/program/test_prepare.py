"""The virtual sensor of the program is made once for each version, and it is a good one."""

import pytest

from app.program import prepare
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.calibration_file import read_calibration


class Stopped(Exception):
    """The user cancels the work."""


def stop(share: float) -> None:
    raise Stopped


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """Return the folders that are searched: that of the program, and that of the user."""
    made = tmp_path / "program", tmp_path / "user"
    monkeypatch.setattr(prepare, "folders", lambda: made)
    return made


def test_every_figure_passes_and_a_cylinder_of_known_size_validates_it(prepared_sensor):
    calibration = read_calibration(prepared_sensor)
    verdicts = {f.key: f.verdict for t in calibration.quality.values() for f in t.figures}
    assert not {key: v for key, v in verdicts.items() if v not in (None, Verdict.PASS)}
    assert calibration.validation is not None and calibration.validation.passed
    camera = prepare.virtual_design().camera
    assert (calibration.camera.width, calibration.camera.height) == (
        camera.width_px,
        camera.height_px,
    )


def test_it_is_made_again_for_another_version_or_if_asked(folders, monkeypatch):
    made = prepare._new_path()
    made.write_bytes(b"made by this version")
    assert made.is_relative_to(folders[0])
    assert prepare.prepare(stop) == made
    with pytest.raises(Stopped):
        prepare.prepare(stop, again=True)  # its code has changed
    monkeypatch.setattr(prepare, "__version__", "99")
    assert prepare.prepared() is None
    with pytest.raises(Stopped):
        prepare.prepare(stop)
    assert prepare.prepared() is None
    assert not prepare._new_path().exists() and not made.exists()


def test_where_the_program_cannot_be_written_it_is_kept_for_the_user(folders):
    folders[0].write_text("no folder")
    made = prepare._new_path()
    assert made.is_relative_to(folders[1])
    made.write_bytes(b"made by this version")
    assert prepare.prepared() == made
