"""Camera settings are stored with the session and the calibration."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.session.camera_settings import CameraSettings, settings_of_texts
from gelpolight_core.session.description import create_session, write_description
from gelpolight_core.session.session import SensorData, Session, read_session

SETTINGS = CameraSettings(
    "UVC Camera (046d:081b)",
    "046d:081b@SN1",
    "046d:081b",
    "YUYV",
    (1280, 960),
    7.5,
    {"exposure_auto": 0.0, "exposure_ms": 15.6, "gain": 64.0},
)


@pytest.fixture
def session(tmp_path):
    sensor = SensorData("A-1", 14.0, 14.0, 1.41, 0.0, 1.49, 26.0)
    board = BoardSpec((9, 6), 3.0)
    made = Session(
        tmp_path / "session",
        sensor,
        board,
        board,
        ball_default_radius_mm=3.0,
        camera_settings=SETTINGS,
    )
    create_session(made)
    return made


def test_a_session_keeps_its_camera(session):
    assert read_session(session.folder).camera_settings == SETTINGS
    write_description(replace(session, declared_response=2.2))
    again = read_session(session.folder)
    assert (again.camera_settings, again.declared_response) == (SETTINGS, 2.2)
    write_description(replace(session, camera_settings=None))
    assert read_session(session.folder).camera_settings is None


@pytest.mark.parametrize(
    ("line", "by", "words"),
    [
        ("exposure_ms = 15.6", 'exposure_ms = "long"', r"\[camera.controls\] exposure_ms"),
        ("width = 1280", "width = -3", r"\[camera.device\] width"),
        ('name = "UVC Camera (046d:081b)"', "name = 7", r"\[camera.device\] name"),
        ('model = "046d:081b"', "colour = 1", "colour is unknown"),
    ],
)
def test_a_mistake_in_it_is_named(session, line, by, words):
    path = session.folder / "session.toml"
    text = path.read_text()
    assert line in text
    path.write_text(text.replace(line, by))
    with pytest.raises(InputError, match=words):
        read_session(session.folder)


words = st.sampled_from(["name", "width", "control.gain", "1e400", "-3", "nan", "", "x" * 999])


@given(st.dictionaries(words, words))
def test_whatever_a_strangers_calibration_says_does_no_harm(texts):
    found = settings_of_texts({"name": "camera", "identity": "x", "width": "nan", **texts})
    if found is not None:
        assert all(abs(value) <= 1e9 for value in found.controls.values())
