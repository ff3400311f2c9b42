"""A camera is opened slowly, set, lost and found again, and never blocks its users."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_camera import C310, FORMATS, FakeCamera, FakeDriver, eventually

from app.sources.camera_drivers.camera_source import CameraSource
from app.sources.camera_drivers.camera_state import AppliedSetting, is_locked
from app.sources.camera_drivers.driver import CameraFormat, without_port
from app.sources.camera_drivers.shared_camera import SharedCamera
from app.sources.source import SourceLost
from app.sources.stoppable_thread import join_unfinished_threads
from app.sources.stream import Stream
from gelpolight_core.session.camera_settings import CameraSettings

LOCKED = {"exposure_auto": 0.0, "exposure_ms": 20.0, "white_balance_auto": 0.0}
LOCKED |= {"white_balance_k": 5000.0, "gain": 30.0, "rate_follows_exposure": 0.0}
STORED = CameraSettings(C310.name, C310.identity, C310.model, "YUYV", (64, 48), 30.0, LOCKED)


@pytest.fixture
def fake():
    return FakeCamera()


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Try a lost camera again after a short pause, and soon count it as away."""
    monkeypatch.setattr("app.sources.camera_drivers.shared_camera.FIRST_PAUSE_S", 0.02)
    monkeypatch.setattr("app.sources.camera_drivers.shared_camera.SILENCE_S", 0.3)


@pytest.fixture
def camera(fake):
    def is_same(one: str, other: str) -> bool:
        return without_port(one) == without_port(other)

    return SharedCamera(FakeDriver(fake), C310, is_same=is_same)


@pytest.fixture
def stream(camera):
    stream = Stream(CameraSource(camera))
    stream.start()
    yield stream
    stream.stop()


def values(camera: SharedCamera) -> dict[str, float]:
    return {control.key: control.value for control in camera.state.controls}


def applied_by(camera: SharedCamera, change: Callable[[], None]) -> dict[str, AppliedSetting]:
    """Change a camera, wait until it is set, and return what was applied."""
    change()
    eventually(lambda: not camera.settling)
    return {applied.key: applied for applied in camera.state.applied}


def test_images_arrive_in_the_best_format_with_their_times(camera, stream):
    frames = stream.capture(3).result(60.0)
    assert frames[0].rgb.shape == (96, 128, 3)
    assert frames[0].time_s < frames[1].time_s < frames[2].time_s <= time.monotonic()
    red, _, blue = frames[0].rgb.mean(axis=(0, 1))
    assert red > blue
    assert camera.state.format == CameraFormat("YUYV", 128, 96, 7.5)
    assert camera.state.offered == FORMATS

    # Images from before a change are not captured.
    applied_by(camera, lambda: camera.change({"exposure_auto": 0.0, "exposure_ms": 10.0}))
    frames = stream.capture(2).result(60.0)
    assert all(frame.settled for frame in frames)
    assert frames[0].rgb[..., 0].mean() == pytest.approx(30.0, abs=2.0)


def test_stored_settings_are_applied_on_opening_and_read_back(camera, stream, fake):
    stream.stop()
    camera.request_settings(STORED)
    fake.calls.clear()
    stream.start()
    stream.capture(1).result(60.0)
    assert values(camera).items() >= LOCKED.items()
    assert all(applied.holds for applied in camera.state.applied)
    assert camera.state.format == CameraFormat("YUYV", 64, 48, 30.0)
    keys = [key for key, _ in fake.calls]
    assert keys.index("exposure_auto") < keys.index("exposure_ms")
    assert keys.index("white_balance_auto") < keys.index("white_balance_k")


def test_ignored_rejected_and_missing_settings_are_reported(camera, stream, fake):
    stream.capture(1).result(60.0)
    fake.ignores, fake.refuses, fake.reads_back = {"gain"}, {"white_balance_k"}, {"sharpness": 9.0}
    wanted = {**LOCKED, "exposure_ms": 9000.0, "sharpness": 20.0, "focus": 3.0}
    applied = applied_by(camera, lambda: camera.change(wanted))
    assert {key for key, a in applied.items() if not a.holds} == {
        *("gain", "white_balance_k", "sharpness", "exposure_ms", "focus")
    }
    assert applied["exposure_ms"].sentence == "Exposure is 500 ms, not 9000 ms"
    assert applied["white_balance_k"].why == "the camera refuses"
    assert applied["focus"].sentence == "Focus: the camera has no such setting"
    assert applied["sharpness"].read == 9.0


def test_an_unplugged_camera_is_reported_and_returns_with_its_settings(camera, stream, fake):
    camera.request_settings(STORED)
    stream.capture(1).result(60.0)
    waiting = stream.capture(10_000)
    fake.plugged, fake.forgets = False, True
    assert "not plugged in" in eventually(
        lambda: (lost := stream.figures().lost) and "plugged" in lost and lost
    )
    with pytest.raises(SourceLost):
        waiting.result(60.0)
    with pytest.raises(SourceLost, match="not plugged in"):
        stream.capture(1).result(60.0)
    fake.plugged = True
    eventually(lambda: stream.figures().lost is None)
    assert len(stream.capture(2).result(60.0)) == 2
    assert values(camera).items() >= LOCKED.items()
    assert fake.opened == 2
    # At another port it continues only with a serial number: it may be another one of its model.
    fake.plugged = False
    eventually(lambda: stream.figures().lost)
    fake.device = replace(C310, identity="046d:081b@1-9:1.0", address="/dev/video5")
    fake.plugged = True
    eventually(lambda: "same port" in (stream.figures().lost or ""))
    fake.device = replace(C310, identity=f"{C310.identity} at 1-9", address="/dev/video5")
    eventually(lambda: stream.figures().lost is None)


def test_a_camera_that_is_silent_or_faulty_or_in_use_is_reopened(camera, stream, fake, caplog):
    fake.stops_after = 20
    eventually(lambda: "no image has arrived" in (stream.figures().lost or ""))
    eventually(lambda: fake.opened >= 2)
    fake.stops_after = None
    eventually(lambda: stream.figures().lost is None)
    eventually(lambda: fake.closed == fake.opened - 1)
    real, fake.light = fake.light, lambda number: 1 // 0
    assert "internal error" in eventually(lambda: stream.figures().lost)
    fake.light = real
    eventually(lambda: stream.figures().lost is None)
    assert "ZeroDivisionError" in caplog.text
    stream.stop()
    fake.in_use = True
    stream.start()
    assert "cannot be opened" in eventually(lambda: stream.figures().lost)
    fake.in_use = False
    eventually(lambda: stream.figures().lost is None)


ANOTHER_WINDOW = """
from fake_camera import C310, FakeCamera, FakeDriver, eventually
from app.sources.camera_drivers.shared_camera import SharedCamera
camera = SharedCamera(FakeDriver(FakeCamera()), C310)
camera.attach(lambda _frame: None)
eventually(lambda: camera.state.phase == "live")
print("live", flush=True)
input()
"""


def test_a_camera_in_another_window_of_the_program_is_refused_with_its_name_until_it_is_free(
    camera,
):
    tests = Path(__file__).parents[3]
    paths = os.pathsep.join(map(str, (tests, tests.parent)))
    window = subprocess.Popen(
        [sys.executable, "-c", ANOTHER_WINDOW],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
        text=True,
    )
    eventually(lambda: window.stdout.readline() == "live\n")
    stream = Stream(CameraSource(camera))
    stream.start()
    why = eventually(camera.trouble)
    assert f"process {window.pid}" in why and C310.name in why
    window.kill()
    window.communicate()
    assert stream.capture(1).result(60.0)
    stream.stop()


def test_closing_during_opening_does_not_block(fake, camera):
    fake.hangs = threading.Event()
    stream = Stream(CameraSource(camera))
    stream.start()
    eventually(lambda: camera.state.phase == "opening")
    stream.stop()
    assert [thread.name for thread in threading.enumerate()].count(f"capture {C310.name}") == 0
    stream.start()  # the driver still hangs in the first open call
    fake.hangs.set()
    assert len(stream.capture(1).result(60.0)) == 1
    stream.stop()
    assert join_unfinished_threads(20.0)
    assert fake.opened == fake.closed
    assert camera.state.phase == "closed"


@pytest.mark.function("Share one camera between pages")
def test_two_users_share_a_camera_and_the_last_one_closes_it(camera, stream, fake):
    stream.capture(1).result(60.0)
    other = Stream(CameraSource(camera))
    other.start()
    assert len(other.capture(2).result(60.0)) == 2
    stream.stop()
    assert len(other.capture(2).result(60.0)) == 2
    other.stop()
    assert (fake.opened, fake.closed) == (1, 1)


def test_another_format_reopens_the_camera(camera, stream, fake):
    stream.capture(1).result(60.0)
    camera.request_settings(STORED)
    eventually(lambda: camera.state.format == CameraFormat("YUYV", 64, 48, 30.0))
    eventually(lambda: values(camera).items() >= LOCKED.items())
    camera.request_settings(replace(STORED, controls={**LOCKED, "gain": 99.0}))
    eventually(lambda: values(camera)["gain"] == 99.0)
    assert fake.opened == 2  # changing only a setting does not reopen the camera


def test_a_lock_fixes_the_present_automatic_values(camera, stream, fake):
    stream.capture(1).result(60.0)
    fake.settings["exposure_ms"] = replace(fake.settings["exposure_ms"], value=21.0)
    applied = applied_by(camera, camera.lock)
    assert applied["exposure_ms"].read == 21.0
    assert is_locked(camera.state.controls)
    assert (
        camera.requested_settings.controls.items()
        >= {"exposure_ms": 21.0, "exposure_auto": 0.0}.items()
    )
    assert camera.requested_settings.size == (128, 96)


def test_a_camera_without_settings_or_formats_still_delivers():
    fake = FakeCamera(formats=(), settings={})
    stream = Stream(CameraSource(SharedCamera(FakeDriver(fake), C310)))
    stream.start()
    (frame,) = stream.capture(1).result(60.0)
    assert frame.rgb.dtype == np.uint8
    stream.stop()


def test_a_slow_reopening_does_not_end_a_stream(camera, fake, monkeypatch):
    monkeypatch.setattr("app.sources.camera_drivers.shared_camera.SLOW_REOPEN_S", 0.05)
    monkeypatch.setattr("app.sources.stream.SILENCE_S", 0.5)
    stream = Stream(CameraSource(camera))
    stream.start()
    stream.capture(1).result(60.0)
    fake.hangs = threading.Event()
    camera.request_settings(STORED)
    eventually(lambda: "being reopened" in (stream.figures().lost or ""))
    time.sleep(0.7)  # longer than a stream may be silent
    assert camera.trouble() == ""
    fake.hangs.set()
    eventually(lambda: stream.figures().lost is None)
    assert len(stream.capture(1).result(60.0)) == 1
    stream.stop()
