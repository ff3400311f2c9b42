"""The live depth as another program receives it."""

import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel, QPushButton

from app.inspect.depth_stream import Publisher
from app.inspect.page import InspectPage
from app.live.frame_viewer import ViewLayout
from app.widgets.dialog import QuestionDialog
from gelpolight_core.reconstruction.reconstructor import Reconstructor

zmq = pytest.importorskip("zmq")
GUIDE = Path(__file__).resolve().parents[3] / "docs" / "reference/streaming.md"
WAIT_MS = 300_000


@pytest.fixture
def page(context, qtbot):
    made = InspectPage(context=context)
    made.views.stage.arrange(
        ViewLayout("camera")
    )  # the stream alone makes depth and normals necessary
    yield made
    made.leave()
    made.can_close()
    made.close()
    made.deleteLater()


@pytest.fixture
def live(page, small_session, small_calibration, context):
    """Return the page with a folder of images as the camera."""
    context.source.choose_folder(small_session / "balls")
    page.enter()
    reconstructor = Reconstructor(small_calibration, model="paper")
    page.live_depth.load(reconstructor, reconstructor)
    return page


def _free_port() -> int:
    with zmq.Context() as context, context.socket(zmq.PUB) as socket:
        return int(socket.bind_to_random_port("tcp://127.0.0.1"))


class Client(threading.Thread):
    """Runs the client of the guide until it has printed twice."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        text = GUIDE.read_text("utf-8").partition("```python\n")[2].partition("```")[0]
        assert "5557" in text
        self._text = text.replace("5557", str(port))
        self.printed: list[tuple[object, ...]] = []
        self.names: dict[str, object] = {"print": self._print}

    def _print(self, *values: object) -> None:
        self.printed.append(values)
        if len(self.printed) == 2:
            raise EOFError

    def run(self) -> None:
        context = zmq.Context.instance()
        context.rcvtimeo = WAIT_MS
        try:
            exec(self._text, self.names)
        except EOFError:
            self.names["socket"].close(linger=0)  # type: ignore[attr-defined]
            context.term()


@pytest.mark.function("Send live depth to other programs")
def test_the_client_of_the_guide_receives_depth_normals_and_health(live, qtbot):
    port = _free_port()
    live.stream.start(port)
    client = Client(port)
    client.start()
    qtbot.waitUntil(lambda: not client.is_alive(), timeout=WAIT_MS)
    (first, _, _, _), (second, deepest, normals, faults) = client.printed
    assert second > first  # type: ignore[operator]
    assert 0.1 < float(deepest) < 5.0  # type: ignore[arg-type]
    arrays = client.names["arrays"]
    assert normals == (*arrays["depth_mm"].shape, 3)  # type: ignore[index]
    length = np.linalg.norm(arrays["normals"], axis=2)  # type: ignore[index]
    assert np.median(length) == pytest.approx(1.0, abs=1e-3)
    assert isinstance(faults, list)
    assert str(port) in live.findChild(QLabel, "inspect.rate").text()
    live.stream.stop()
    assert str(port) not in live.findChild(QLabel, "inspect.rate").text()


def test_a_frozen_image_is_sent_once(live, qtbot, monkeypatch):
    sent: list[object] = []
    monkeypatch.setattr(Publisher, "send", lambda _publisher, parts: sent.append(parts))
    live.stream.start(_free_port())
    qtbot.waitUntil(lambda: len(sent) > 0, timeout=WAIT_MS)
    live.pause(True)
    qtbot.waitUntil(lambda: live.live_depth.last is not None, timeout=WAIT_MS)
    before = len(sent)
    for _ in range(3):
        live.live_depth.shown.emit(live.live_depth.last)
    assert len(sent) <= before + 1


def test_the_network_is_opened_only_after_a_confirmation_and_faults_are_named(page, monkeypatch):
    page.show_stream()
    dialog = page.stream._dialog
    assert dialog is not None and dialog.form.value.reach is False
    dialog.form.change(reach=True, port=_free_port())
    dialog.button.click()
    assert not page.stream.on
    (question,) = dialog.findChildren(QuestionDialog)
    agree = question.findChild(QPushButton, "question.answer0")
    agree.click()
    assert page.stream.on and page.stream.address.startswith("tcp://0.0.0.0:")
    assert "NETWORK" in dialog.state.text()
    dialog.button.click()
    assert not page.stream.on
    # A port in use, and a missing package.
    with zmq.Context() as context, context.socket(zmq.PUB) as socket:
        dialog.form.change(reach=False, port=socket.bind_to_random_port("tcp://127.0.0.1"))
        dialog.button.click()
        assert "cannot be used" in dialog.state.text()
    monkeypatch.setitem(sys.modules, "zmq", None)
    dialog.button.click()
    assert "pip install" in dialog.state.text() and not page.stream.on
