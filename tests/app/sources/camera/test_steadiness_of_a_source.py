"""The stability test on live frames tells a camera that stands still from one that does not."""

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


def test_a_camera_that_still_follows_the_light_is_found_out() -> None:
    table = verdict_on(FakeCamera(light=lambda number: 1.0 + 0.002 * number))
    assert table["camera_drift_percent"].verdict is Verdict.FAIL


def test_a_camera_whose_picture_is_frozen_is_found_out() -> None:
    assert verdict_on(FakeCamera(frozen=True))["camera_repeated"].verdict is Verdict.FAIL
