"""The live view: what it shows, where, and what the user can do with it."""

import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QColor, QImage
from PySide6.QtWidgets import QApplication, QLabel, QWidget

from app.live.image_checks import pixel_text
from app.live.image_view import ImageView
from app.live.live_view import LiveView
from app.live.overlay import ImageOverlay, OverlayCircle, OverlayLine, OverlayMarker, OverlayMask
from app.live.overlay_item import ROLE_COLOURS
from tests.app import mouse

HEIGHT, WIDTH = 60, 80


class Slot:
    """A slot for one frame."""

    def __init__(self) -> None:
        self.frame: Any = None
        self.lock = threading.Lock()

    def take(self) -> Any:
        """Return the frame and empty the slot."""
        with self.lock:
            frame, self.frame = self.frame, None
        return frame


class FakeStream:
    """A stream into which a test puts frames."""

    def __init__(self) -> None:
        self.newest = Slot()
        self.lost: str | None = None

    def put(self, rgb: np.ndarray) -> None:
        """Make `rgb` the newest frame."""
        self.newest.frame = SimpleNamespace(rgb=rgb, number=1, time_s=0.0)

    def figures(self) -> SimpleNamespace:
        """Return the figures of the stream."""
        return SimpleNamespace(rate_hz=30.0, made=1, dropped=2, lost=self.lost)


@pytest.fixture
def view(qtbot):
    """Return a visible view."""
    made = LiveView()
    qtbot.addWidget(made)
    made.resize(900, 760)
    with qtbot.waitExposed(made):
        made.show()
    for floating in (made.bar, made._checks):  # they cover pixels that the tests read
        floating.hide()
    return made


def test_labels_without_text_are_hidden(view):
    labels = [view.findChild(QLabel, f"live.{name}") for name in ("zoom", "exposure", "pixel")]
    assert all(label.isHidden() for label in labels)
    view.show_image(black())
    assert any(label.text() for label in labels)
    assert all(label.text() or label.isHidden() for label in labels)
    view.set_stream(None)
    assert all(label.isHidden() for label in labels)


def black() -> np.ndarray:
    """Return a black image."""
    return np.zeros((HEIGHT, WIDTH, 3), np.uint8)


def child(view: LiveView, name: str) -> Any:
    """Return a part of the view by its object name."""
    found = view.findChild(QWidget, name)
    return found


def pixels(widget: QWidget) -> np.ndarray:
    """Return the pixels of a widget, (rows, columns, 3)."""
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
    return flat[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()


def middle(mask: np.ndarray) -> tuple[float, float]:
    """Return the centroid (x, y) of true pixels, in points from the first pixel's corner."""
    rows, columns = np.nonzero(mask)
    assert rows.size
    return float(columns.mean() + 0.5), float(rows.mean() + 0.5)


def place_of(view: ImageView, u: float, v: float) -> tuple[float, float]:
    """Return where a point of the image is in its view."""
    at = view.mapFromScene(view.box.mapViewToScene(QPointF(u, v)))
    return at.x(), at.y()


def drag(view: LiveView, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag with the left button from one image point to another."""
    image_view = child(view, "live.image")
    points = (QPointF(*place_of(image_view, *at)) for at in (start, end))
    mouse.drag(image_view.viewport(), *points)
    QApplication.processEvents()


def test_a_marker_sits_on_the_centre_of_its_pixel(view):
    rgb = black()
    rgb[20, 30] = (60, 60, 60)
    view.show_image(rgb)
    image_view = child(view, "live.image")
    pixel = middle(pixels(image_view)[..., 0] > 50)
    green = np.array(QColor(ROLE_COLOURS["good"]).getRgb()[:3])
    for kind in ("cross", "plus", "ring", "dot"):
        view.set_overlay(ImageOverlay(markers=(OverlayMarker(30.0, 20.0, kind, "good"),)))
        marked = (np.abs(pixels(image_view).astype(int) - green) < 60).all(axis=2)
        assert middle(marked) == pytest.approx(pixel, abs=1.0), kind


def test_every_kind_of_mark_shows_and_can_be_switched_off(view):
    view.show_image(black())
    image_view = child(view, "live.image")
    bare = pixels(image_view)
    area = np.zeros((HEIGHT, WIDTH), bool)
    area[5:9, 5:9] = True
    items: dict[str, Any] = {
        "markers": OverlayMarker(40.0, 30.0, "cross", "good", text="1"),
        "circles": OverlayCircle(40.0, 30.0, 12.0, "expected", handle="ball"),
        "lines": OverlayLine(
            np.array([[5.0, 50.0], [70.0, 50.0], [70.0, 55.0]]), "info", closed=True
        ),
        "masks": OverlayMask(area, "bad"),
    }
    for kind, item in items.items():
        view.set_overlay(ImageOverlay(**{kind: (item,)}))
        assert (pixels(image_view) != bare).any(), kind
    view.tools["overlay"].trigger()
    np.testing.assert_array_equal(pixels(image_view), bare)
    view.set_overlay(ImageOverlay(masks=(OverlayMask(area, "good"),)))
    np.testing.assert_array_equal(pixels(image_view), bare)


def test_a_circle_is_resized_and_moved_by_mouse_and_keys(view, qtbot):
    view.show_image(black())

    def lay() -> None:
        view.set_overlay(
            ImageOverlay(circles=(OverlayCircle(40.0, 30.0, 12.0, "good", handle="ball"),))
        )

    lay()
    with qtbot.waitSignal(view.moved) as reported:
        drag(view, (52.0, 30.0), (56.0, 30.0))
    assert reported.args == ["ball", *(pytest.approx(x, abs=0.15) for x in (40.0, 30.0, 16.0))]
    lay()
    qtbot.keyClick(view, Qt.Key.Key_PageDown)
    with qtbot.waitSignal(view.moved) as reported:
        qtbot.keyClick(view, Qt.Key.Key_Right)
        qtbot.keyClick(view, Qt.Key.Key_Up, Qt.KeyboardModifier.ShiftModifier)
        qtbot.keyClick(view, Qt.Key.Key_Plus)
        qtbot.keyClick(view, Qt.Key.Key_Minus, Qt.KeyboardModifier.ControlModifier)
    assert reported.args == ["ball", *(pytest.approx(x) for x in (40.2, 28.0, 10.2))]
    # A handle is dragged before the object below it.
    view.image.hand_drags_on(True)
    lay()
    with qtbot.assertNotEmitted(view.image.dragged), qtbot.waitSignal(view.moved):
        drag(view, (40.0, 30.0), (45.0, 30.0))


def test_the_newest_frame_of_a_stream_is_shown_or_why_it_is_lost(view, qtbot):
    stream = FakeStream()
    view.set_stream(stream)
    rgb = black()
    rgb[:] = (0, 90, 0)
    stream.put(rgb)
    image_view = child(view, "live.image")
    qtbot.waitUntil(lambda: bool((pixels(image_view)[300, 450] == (0, 90, 0)).all()))
    assert not child(view, "live.focus").isHidden()
    stream.lost = "Camera: it was unplugged. Plug it in again."
    qtbot.waitUntil(lambda: child(view, "live.exposure").text() == stream.lost)


@pytest.mark.function("Use 16-bit images")
def test_sixteen_bit_frames_are_shown_with_their_own_values(view):
    rgb = np.full((HEIGHT, WIDTH, 3), 30000, np.uint16)
    view.show_image(rgb)
    assert (pixels(child(view, "live.image"))[300, 450] == 30000 >> 8).all()
    assert pixel_text(rgb, 3.4, 4.6) == (
        "u 3, v 5:  R 30000 (46 %)   G 30000 (46 %)   B 30000 (46 %)"
    )


@pytest.mark.function("Save a snapshot with exact values")
def test_a_snapshot_contains_the_exact_values_and_no_marks(view, qtbot, tmp_path):
    with qtbot.waitSignal(view.refused) as reported:
        view.tools["snapshot"].trigger()
    assert "there is no image" in reported.args[0] and "Select a source" in reported.args[0]

    random, view.snapshot_folder = np.random.default_rng(1), tmp_path / "snapshots"
    for dtype in (np.uint8, np.uint16):
        rgb = random.integers(0, np.iinfo(dtype).max, (HEIGHT, WIDTH, 3), dtype)
        view.show_image(rgb)
        view.set_overlay(ImageOverlay(circles=(OverlayCircle(40.0, 30.0, 12.0, "good"),)))
        view.tools["zebra"].trigger()
        with qtbot.waitSignal(view.saved) as reported:
            view.tools["snapshot"].trigger()
        assert Path(reported.args[0]).parent == tmp_path / "snapshots"
        read = cv2.imread(reported.args[0], cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(read[..., ::-1], rgb)


def test_fit_full_size_and_double_click(view):
    view.show_image(black())
    image_view = child(view, "live.image")
    fitted = image_view.scale_px
    assert fitted == pytest.approx(
        min(image_view.width() / WIDTH, image_view.height() / HEIGHT), rel=0.02
    )
    view.image.full_size()
    assert image_view.scale_px == pytest.approx(1.0, rel=1e-6)
    assert child(view, "live.zoom").text() == "100 %"
    view.resize(700, 600)
    assert image_view.scale_px == pytest.approx(1.0, rel=0.01)
    position = place_of(image_view, 20.0, 20.0)
    mouse.send(
        image_view.viewport(), QEvent.Type.MouseButtonDblClick, QPointF(*position), mouse.LEFT
    )
    mouse.send(image_view.viewport(), QEvent.Type.MouseButtonRelease, QPointF(*position))
    assert image_view.scale_px > 4.0
    view.image.full_size()
    view.image.fit()
    assert image_view.scale_px > 4.0
    view.resize(500, 400)
    QApplication.processEvents()
    assert image_view.scale_px == pytest.approx(
        min(image_view.width() / WIDTH, image_view.height() / HEIGHT), rel=0.02
    )


def test_requested_drags_are_emitted_and_do_not_pan(view, qtbot):
    view.show_image(black())
    view.image.hand_drags_on(True)
    image_view = child(view, "live.image")
    before = place_of(image_view, 40.0, 30.0)
    reported: list[tuple[str, float, float]] = []
    view.image.dragged.connect(lambda *what: reported.append(what))
    with qtbot.assertNotEmitted(view.image.clicked):
        drag(view, (40.0, 30.0), (50.0, 20.0))
    assert [phase for phase, _, _ in reported] == ["begin", *["move"] * (len(reported) - 2), "end"]
    assert reported[0][1:] == pytest.approx((40.0, 30.0), abs=0.2)
    assert reported[-1][1:] == pytest.approx((50.0, 20.0), abs=0.2)
    assert place_of(image_view, 40.0, 30.0) == pytest.approx(before, abs=1.0)
