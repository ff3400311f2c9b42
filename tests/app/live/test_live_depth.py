"""Live depth shows a fault once it lasts, and uses a calibration only for its own sensor."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_camera import C310, FakeCamera, FakeDriver, eventually
from PySide6.QtWidgets import QWidget

from app.live.live_depth import LiveDepth
from app.live.live_session import LiveSession
from app.live.next_step_advice import action_of, advise
from app.program.jobs import JobQueue
from app.sources.latest import Done
from app.sources.source import SourceFrame
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.health.frame_health import FrameHealth

DIM = Finding("exposure", "the light is darker", remedy="Restore it", verdict=Verdict.WARN)


@pytest.fixture
def depth(context, qtbot):
    live, owner = LiveSession(context=context, name="test"), QWidget()
    qtbot.addWidget(owner)
    made = LiveDepth(live, JobQueue("test", live), owner, context=context)
    yield made
    made.finish()


def outcome(health: FrameHealth, time_s: float, *, settled: bool = True) -> Any:
    """Return the result of a frame, as far as its health goes."""
    frame = SimpleNamespace(time_s=time_s, settled=settled, rgb=np.zeros((4, 6, 3), np.uint8))
    heightmap = SimpleNamespace(trace=None)
    return Done(frame, SimpleNamespace(frame=frame, heightmap=heightmap, health=health))


def test_a_fault_that_lasts_is_shown_and_forgotten_with_the_camera(depth):
    faults = list[str]()
    depth.changed.connect(lambda: faults.append(getattr(depth.state.fault, "key", "")))
    for n in range(20):
        depth.live.processed.emit(outcome(FrameHealth((DIM,)), 0.1 * n))
    assert faults[-1] == "exposure"
    assert faults.count("exposure") == 1, "its figure changes with every frame, the advice does not"
    depth.live.open()
    assert faults[-1] == ""
    for n in range(20):
        depth.live.processed.emit(outcome(FrameHealth((DIM,)), 0.1 * n, settled=False))
    assert depth.state.fault is None, "the camera is still settling"


def test_a_calibration_is_used_only_for_images_of_its_sensor_and_size(depth):
    camera = SimpleNamespace(width=6, height=4)
    calibration = SimpleNamespace(camera=camera, serial="A")
    calibration.provenance = SimpleNamespace(camera_settings={})
    reconstructor: Any = SimpleNamespace(calibration=calibration)
    loaded, switched = list[object](), list[object]()
    depth.calibration_loaded.connect(lambda live, _best: loaded.append(live))
    depth.calibration_switched.connect(lambda: switched.append(depth.live_reconstructor))
    depth.load(reconstructor, reconstructor)
    assert loaded == [reconstructor]
    assert depth.live_reconstructor is None, "no camera is selected"
    depth._context.source.choose(SimpleNamespace(kind="camera", name="A", detail=""))  # type: ignore[arg-type]
    depth.choose(reconstructor, reconstructor)
    assert depth.live_reconstructor is reconstructor
    large = SourceFrame(np.zeros((8, 6, 3), np.uint8), 0, 0.0)
    depth.live.processed.emit(Done(large, None, "Another size."))
    assert depth.live_reconstructor is None
    assert switched == [reconstructor, None]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("1-2:1.0", "1-3:1.0"),
        ("3F2A9C10/1.0 at 1-2", "77B01C35/1.0 at 1-2"),
        ("200901010001/1.0 at 1-2", "200901010001/1.0 at 1-3"),
    ],
    ids=["ports", "numbers at one port", "one placeholder"],
)
def test_a_calibration_of_another_camera_is_used_only_if_the_user_says_that_it_is_the_same(
    depth, first, second
):
    """Two cameras of one model with different identities; only the second is connected."""
    context = depth._context
    there = replace(C310, identity=f"046d:081b@{second}")
    context.cameras.driver = FakeDriver(FakeCamera(device=there))
    context.source.choose(context.cameras.infos()[0])
    calibration = SimpleNamespace(camera=SimpleNamespace(width=6, height=4), serial="A")
    texts = {"name": C310.name, "identity": f"046d:081b@{first}", "model": C310.model}
    calibration.provenance = SimpleNamespace(camera_settings=texts)
    reconstructor: Any = SimpleNamespace(calibration=calibration)
    depth.choose(reconstructor, reconstructor)
    advice = advise(depth.state)
    assert depth.live_reconstructor is None
    assert advice is not None and advice.verdict is Verdict.FAIL
    assert action_of(advice) == "same_camera"
    assert f"046d:081b@{first}" in advice.text and there.identity in advice.text
    depth.act(action_of(advice))
    assert depth.live_reconstructor is reconstructor
    assert action_of(advise(depth.state)) != "same_camera"


@pytest.mark.function("Set a camera back to the calibration's image size with one button")
def test_a_camera_with_another_image_size_is_set_to_that_of_the_calibration(depth, qtbot):
    context, camera = depth._context, FakeCamera()
    context.cameras.driver = FakeDriver(camera)
    (info,) = context.cameras.infos()
    context.source.choose(info)
    calibration = SimpleNamespace(camera=SimpleNamespace(width=128, height=96), serial="A")
    calibration.provenance = SimpleNamespace(camera_settings={})
    reconstructor: Any = SimpleNamespace(calibration=calibration)
    depth.choose(reconstructor, reconstructor)
    shared = context.cameras.of(info)
    small = next(f for f in camera.formats if (f.width, f.height) == (64, 48))
    context.cameras.choose_format(shared, small)
    stream_reader = list[SourceFrame]().append
    shared.attach(stream_reader)
    try:
        eventually(lambda: shared.state.format == small)
        depth.live.processed.emit(Done(SourceFrame(np.zeros((48, 64, 3), np.uint8), 0, 0.0), None))
        advice = advise(depth.state)
        assert action_of(advice) == "image_size" and "128x96" in advice.text
        depth.act("image_size")
        eventually(lambda: (shared.state.format.width, shared.state.format.height) == (128, 96))
        assert not shared.state.format.compressed
    finally:
        shared.detach(stream_reader)


def test_all_pages_continue_one_colour_range_until_another_source_is_selected(
    depth, context, qtbot
):
    other, owner = LiveSession(context=context, name="other page"), QWidget()
    qtbot.addWidget(owner)
    second = LiveDepth(other, JobQueue("other", other), owner, context=context)
    press = np.full((40, 40), 0.9, np.float32)
    for name in "AB":
        camera = SimpleNamespace(kind="camera", name=name, detail="")
        context.source.choose(camera)  # type: ignore[arg-type]
        assert depth._maker.colour_range.update(0.5 * press, 0.0) == (0.0, pytest.approx(0.6))
        assert depth._maker.colour_range.update(press, 0.1) == (0.0, pytest.approx(1.2))
        assert second._maker.colour_range.update(0.5 * press, 0.2) == (0.0, pytest.approx(1.2))
    second.finish()
