"""The live session: captures, stale results, and what the status bar says about the source."""

import threading

import cv2
import numpy as np
import pytest

from app.live.live_session import LiveSession
from app.sources.source import SourceFrame, SourceInfo, SourceLost, SourceSetting

WAIT_MS = 60_000


class Camera:
    """Delivers frames while it is let; can be lost."""

    name, kind, size = "Camera A", "camera", (6, 4)

    def __init__(self) -> None:
        self.going, self.lost = threading.Event(), threading.Event()
        self.going.set()
        self._number = 0

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def settings(self) -> tuple[SourceSetting, ...]:
        return ()

    def frame(self, timeout_s: float) -> SourceFrame | None:
        if self.lost.is_set():
            raise SourceLost("it was unplugged", where=self.name, advice="Plug it in")
        if not self.going.wait(timeout_s):
            return None
        threading.Event().wait(0.005)
        self._number += 1
        image = np.full((4, 6, 3), self._number % 256, np.uint8)
        return SourceFrame(image, self._number, threading.TIMEOUT_MAX)

    @property
    def info(self) -> SourceInfo:
        return SourceInfo("camera", self.name, "", lambda: self)


@pytest.fixture
def camera():
    return Camera()


@pytest.fixture
def live(context, camera):
    session = LiveSession(context=context, name="test")
    context.source.choose(camera.info)
    yield session
    session.finish()


def test_a_frozen_frame_is_not_replaced_by_one_that_was_in_progress(live, qtbot):
    begun, go_on = threading.Event(), threading.Event()

    def slow(frame: SourceFrame) -> int:
        begun.set()
        go_on.wait(WAIT_MS / 1e3)
        return frame.number

    live.enter(True)
    live.process(slow)
    assert begun.wait(WAIT_MS / 1e3)
    numbers = list[int]()
    live.processed.connect(lambda item: numbers.append(item.result))
    live.pause(True)
    live.process_again(SourceFrame(np.zeros((4, 6, 3), np.uint8), -7, 0.0))
    go_on.set()
    qtbot.waitUntil(lambda: bool(numbers), timeout=WAIT_MS)
    assert numbers == [-7]


def test_the_source_is_open_only_while_the_page_is_visible_and_needs_images(live, qtbot):
    assert live.stream is None
    live.enter(True)
    live.process(lambda frame: frame.number)
    with qtbot.waitSignal(live.processed, timeout=WAIT_MS):
        pass
    live.use(False)
    assert live.stream is None
    live.use(True)
    assert live.stream is not None
    live.enter(False)
    assert live.stream is None


def test_a_capture_delivers_images_and_one_that_is_cut_short_is_reported(live, camera, qtbot):
    images, failed, aborted = list[object](), list[str](), list[str]()
    live.capture(2, images.extend, failed.append, aborted=aborted.append)
    assert len(failed) == 1, "there is no camera yet"
    live.enter(True)
    live.capture(2, images.extend, failed.append, aborted=aborted.append)
    qtbot.waitUntil(lambda: len(images) == 2, timeout=WAIT_MS)
    camera.going.clear()
    live.capture(50, images.extend, failed.append, aborted=aborted.append)
    assert live.capturing
    live.enter(False)
    assert not live.capturing
    assert (len(images), len(failed), len(aborted)) == (2, 1, 1)


def test_a_lost_camera_is_reported_until_it_is_opened_again(live, camera, qtbot):
    reasons = list[str]()
    live.lost.connect(reasons.append)
    live.enter(True)
    camera.lost.set()
    qtbot.waitUntil(lambda: bool(reasons), timeout=WAIT_MS)
    assert "unplugged" in reasons[-1]
    camera.lost.clear()
    live.open()
    assert reasons[-1] == ""


@pytest.mark.function("Go to another page: a folder or recording stays at its image")
def test_the_next_page_opens_a_folder_at_the_image_of_the_page_before(
    live, context, qtbot, tmp_path
):
    for name in ("a.png", "b.png", "c.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((4, 6, 3), np.uint8))
    context.source.choose_folder(tmp_path)
    other = LiveSession(context=context, name="other page")
    names = list[str]()
    for session in (live, other):
        session.process(lambda frame: names.append(frame.name))
    live.enter(True)
    qtbot.waitUntil(lambda: names[-1:] == ["a.png"], timeout=WAIT_MS)
    live.source.step(2)
    qtbot.waitUntil(lambda: names[-1:] == ["c.png"], timeout=WAIT_MS)
    live.enter(False)
    names.clear()
    other.enter(True)
    qtbot.waitUntil(lambda: bool(names), timeout=WAIT_MS)
    assert set(names) == {"c.png"}
    context.source.choose_folder(tmp_path)  # chosen again: from the start
    qtbot.waitUntil(lambda: names[-1] == "a.png", timeout=WAIT_MS)
    other.finish()
