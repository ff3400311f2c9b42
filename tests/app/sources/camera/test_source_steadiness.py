"""The stability test on live frames distinguishes stable and unstable cameras."""

from __future__ import annotations

from fake_camera import C310, FakeCamera, FakeDriver, eventually

from app.sources.camera.camera import Camera
from app.sources.camera.camera_source import CameraSource
from app.sources.camera.steadiness import SteadinessTest
from app.sources.stream import Stream
from gelpolight_core.quality import QualityTable, Verdict


def verdict_on(fake: FakeCamera) -> QualityTable:
    camera = Camera(FakeDriver(fake), C310)
    stream = Stream(CameraSource(camera))
    test = SteadinessTest(0.0, span_s=0.2)
    stream.add_tap(test.take)
    stream.start()
    eventually(lambda: test.share >= 1.0)
    stream.stop()
    return test.result()


def test_a_locked_camera_passes() -> None:
    assert verdict_on(FakeCamera()).verdict is Verdict.PASS


def test_a_camera_with_automatic_exposure_is_detected() -> None:
    table = verdict_on(FakeCamera(light=lambda number: 1.0 + 0.002 * number))
    assert table["camera_drift_percent"].verdict is Verdict.FAIL


def test_a_camera_with_a_frozen_image_is_detected() -> None:
    assert verdict_on(FakeCamera(frozen=True))["camera_repeated"].verdict is Verdict.FAIL
