"""A map in mm: its axes, its image, the pointer, and the handles of the colour bar."""

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPointF, QRectF

from app.inspect.section_panel import SectionMarks
from app.live.frame_processor import FrameProcessor, FrameRequest
from app.live.frame_viewer import HeightPanel
from app.sources.source import SourceFrame
from app.views.map.map_view import MapView
from gelpolight_core.reconstruction.height_map import HeightMap
from tests.app import mouse

RED, BLUE = (250, 10, 10), (10, 10, 250)
EXTENT = (-8.0, -5.0, 8.0, 5.0)


def _marked() -> np.ndarray:
    """Return an image that is red with a blue block at x 4 to 8, y -5 to -2.5 mm."""
    rgb = np.full((40, 64, 3), RED, np.uint8)
    rgb[:10, 48:] = BLUE
    return rgb


@pytest.fixture
def view(qtbot):
    made = MapView("map", "Map")
    qtbot.addWidget(made)
    made.resize(500, 400)
    made.show()
    qtbot.waitExposed(made)
    return made


def _seen(view: MapView, x_mm: float, y_mm: float) -> tuple[int, ...]:
    at = view.box.mapViewToScene(QPointF(x_mm, y_mm))
    return view.grab().toImage().pixelColor(round(at.x()), round(at.y())).getRgb()[:3]


def _labels(view: MapView, side: str) -> dict[str, float]:
    """Return the labels of an axis, each with its value in mm."""
    axis = view._plot.getAxis(side)
    low, high = axis.range
    length = axis.width() if side == "bottom" else axis.height()
    spacing, values = axis.tickValues(low, high, length)[0]
    return dict(zip(axis.tickStrings(values, 1.0, spacing), map(float, values), strict=True))


def test_x_is_right_and_y_is_down_as_the_axes_say(view, qtbot):
    view.set_image(_marked(), EXTENT)
    qtbot.wait(50)  # lays out
    assert _seen(view, 6.0, -4.0) == BLUE
    assert {_seen(view, x, y) for x, y in ((-6.0, -4.0), (6.0, 4.0), (3.5, -4.0), (6.0, -2.0))} == {
        RED
    }
    box = view.box.sceneBoundingRect()
    for side, low, high in (
        ("bottom", QPointF(box.left(), 0.0), QPointF(box.right(), 0.0)),
        ("left", QPointF(0.0, box.top()), QPointF(0.0, box.bottom())),
    ):
        ends = [view.box.mapSceneToView(p) for p in (low, high)]
        found = [p.x() if side == "bottom" else p.y() for p in ends]
        assert sorted(view._plot.getAxis(side).range) == pytest.approx(found, abs=0.05)
        labels = _labels(view, side)
        assert len(labels) >= 2
        assert all(float(text) == pytest.approx(value) for text, value in labels.items())


def test_a_millimetre_has_one_length_whatever_the_window(view, qtbot):
    view.set_image(_marked(), EXTENT)
    for size in ((500, 400), (900, 300), (300, 700)):
        view.resize(*size)
        qtbot.wait(20)
        width, height = view.box.viewPixelSize()
        assert width == pytest.approx(height, rel=0.01)
        assert view.box.viewRect().contains(QRectF(-8.0, -5.0, 16.0, 10.0))


def test_the_scale_bar_is_as_long_as_it_says(view):
    view.set_image(_marked(), EXTENT)
    for zoom in (1.0, 0.3, 0.1):
        view.box.scaleBy((zoom, zoom))
        scale = view._scale
        px_per_mm = 1.0 / view.box.viewPixelSize()[0]
        assert scale.bar.rect().width() == pytest.approx(scale.size * px_per_mm, rel=0.01)
        text, unit = scale.text.toPlainText().split()
        assert float(text) * {"mm": 1.0, "um": 1e-3}[unit] == pytest.approx(scale.size)


# The colour range


@pytest.fixture
def shown(dome):
    class Reconstruction:
        def depth(self, _rgb: object, **_requested: object) -> HeightMap:
            return dome

    processor = FrameProcessor(Reconstruction())  # type: ignore[arg-type]
    processor.wanted = FrameRequest(height=True)
    return processor(SourceFrame(np.zeros((4, 6, 3), np.uint8), 0, 0.0))


@pytest.fixture
def panel(qtbot, shown):
    made = HeightPanel(SectionMarks(lambda: None), adjustable=True)
    qtbot.addWidget(made)
    made.resize(420, 420)
    made.show()
    qtbot.waitExposed(made)
    made.show_frame(shown, still=False)
    qtbot.wait(50)
    return made


def _ends(panel: HeightPanel) -> tuple[QPointF, QPointF, float]:
    """Return the positions of the lower and the upper end of the colours, and their distance."""
    box = panel.map.bar.getViewBox().sceneBoundingRect()
    x = box.center().x()
    return QPointF(x, box.bottom() - 2.0), QPointF(x, box.top() + 2.0), box.height()


def test_an_end_of_the_colours_is_dragged_and_no_frame_moves_it_meanwhile(panel, shown):
    ranges: list[tuple[float, float]] = []
    panel.map.bar.range_dragged.connect(lambda low, high: ranges.append((low, high)))
    _low, high, length = _ends(panel)
    to = high - QPointF(0.0, 0.5 * length)
    mouse.drag(panel.map.viewport(), high, to, drop=False)
    dragged = panel.map.bar.levels()
    assert dragged[0] == 0.0 and 1.5 < dragged[1] < 2.5
    panel.show_frame(shown, still=False)
    assert panel.map.bar.levels() == dragged
    mouse.send(panel.map.viewport(), QEvent.Type.MouseButtonRelease, to)
    assert ranges[-1] == dragged
    panel.show_frame(shown, still=False)
    assert panel.map.bar.levels() == shown.range_mm
