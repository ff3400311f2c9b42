"""The 3D view on a screen: content, positions, mouse and keys."""

import gc
import itertools
import weakref
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QGuiApplication, QOpenGLContext, QSurface
from PySide6.QtWidgets import QLabel, QMainWindow, QMenu, QWidget
from pytestqt.qtbot import QtBot
from shiboken6 import getAllValidWrappers

from app.program.display import DisplayStore
from app.program.jobs import JobQueue
from app.views.map.colour_tables import colour_table
from app.views.surface.display_surface import SurfaceLine, surface_of
from app.views.surface.overlays import BAR, FONT, VIEWS
from app.views.surface.panel import SurfacePanel
from app.views.surface.scene import OffscreenScene
from app.widgets.layout import hbox
from gelpolight_core.geometry.membrane_shape import MembraneShape
from tests.app.views.surface.conftest import BUMP, SMALL, WAIT_MS, flat_map, pixels

PLAIN = {"axes": False, "colour_bar": False, "orientation": False}


def _screen_px(panel: SurfacePanel, x: float, y: float, depth: float) -> QPointF:
    """Return the position where VTK projects a point of the sensor, in the view's pixels."""
    view = panel.view
    assert view is not None
    view.renderer.SetWorldPoint(x, -y, view.scene.style.exaggeration * depth, 1.0)
    view.renderer.WorldToDisplay()
    across, up, _ = view.renderer.GetDisplayPoint()
    ratio = view.devicePixelRatioF()
    return QPointF(across / ratio, view.height() - 1 - up / ratio)


def _drawn(panel: SurfacePanel, qtbot: QtBot) -> np.ndarray:
    view = panel.view
    assert view is not None
    before = view.drawings
    view.update()
    qtbot.waitUntil(lambda: view.drawings > before, timeout=WAIT_MS)
    return pixels(panel.view.grabFramebuffer())


def _colour_at(image: np.ndarray, at: QPointF) -> np.ndarray:
    row, column = round(at.y()), round(at.x())
    return np.median(image[row - 1 : row + 2, column - 1 : column + 2].reshape(-1, 3), axis=0)


def test_each_point_has_the_colour_of_its_depth(panel, qtbot):
    panel.display.change(**PLAIN)
    low, high = colour_table("viridis")[[0, 255]].astype(float)
    for view in VIEWS:
        panel.view_from(view)
        image = _drawn(panel, qtbot)
        # From the front and the side the tops are seen edge-on: their walls instead.
        for x, y, depth in (BUMP, SMALL) if view in ("top", "isometric") else ():
            expected = colour_table("viridis")[round(255 * depth)]
            found = _colour_at(image, _screen_px(panel, x, y, depth))
            assert np.abs(found - expected).max() < 12
        assert (np.abs(image - low).max(axis=2) < 14).sum() > 300
        assert (np.abs(image - high).max(axis=2) < 30).sum() > 20


def test_from_the_top_the_surface_lies_as_in_the_camera_s_image(panel):
    panel.view_from("top")
    centre, right, down = (_screen_px(panel, *at, 0.0) for at in ((0, 0), (2, 0), (0, 2)))
    assert right.x() > centre.x() + 10 and right.y() == pytest.approx(centre.y(), abs=0.5)
    assert down.y() > centre.y() + 10 and down.x() == pytest.approx(centre.x(), abs=0.5)


def test_pointing_finds_the_visible_point(panel):
    for parallel, view, exaggeration in itertools.product(
        (False, True), ("isometric", "top"), (1.0, 4.0)
    ):
        panel.display.change(parallel=parallel, exaggeration=exaggeration)
        panel.view_from(view)
        for x, y, depth in (BUMP, SMALL, (-2.0, -4.0, 0.0)):
            found = panel.view.point_at(_screen_px(panel, x, y, depth))  # type: ignore[union-attr]
            assert found == pytest.approx((x, y), abs=0.15)  # a node


@pytest.mark.function("Pins show the depth of the present frame, and go with the source")
def test_pins_take_their_depth_from_each_frame_and_go_with_the_source(panel, made):
    view = panel.view
    assert view is not None
    panel.set_pins((BUMP[:2],))
    panel.show_surface(made(factor=0.5))
    (height,) = view.actors["pins-points"].mapper.dataset.points[:, 2]
    assert height == pytest.approx(view.scene.style.exaggeration * 0.5 * BUMP[2], abs=0.01)
    assert "0.500 mm" in view.actors["pin-text"].GetText(1)
    panel.show_message("No depth yet.")  # the source or the calibration changed
    panel.show_surface(made())
    assert not [name for name in view.actors if name.startswith("pin")]


def test_a_click_sets_a_pin_and_a_drag_rotates(panel, qtbot):
    panel.view_from("top")
    view = panel.view
    assert view is not None
    at = _screen_px(panel, *BUMP).toPoint()
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=at)
    (pin,) = panel.pins
    assert pin == pytest.approx(BUMP[:2], abs=0.15)
    before = view.camera.position
    qtbot.mousePress(view, Qt.MouseButton.LeftButton, pos=at)
    qtbot.mouseMove(view, at + QPoint(60, 30))
    qtbot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=at + QPoint(60, 30))
    assert len(panel.pins) == 1
    assert view.camera.position != before


@pytest.mark.function("Rotate, pan and zoom the surface")
def test_a_right_click_asks_for_the_menu_and_a_right_drag_zooms(panel, qtbot):
    view = panel.view
    assert view is not None
    asked: list[QPoint] = []
    view.menu_wanted.disconnect()
    view.menu_wanted.connect(asked.append)
    qtbot.mouseClick(view, Qt.MouseButton.RightButton, pos=QPoint(100, 100))
    assert asked == [QPoint(100, 100)]
    before = view.camera.position
    qtbot.mousePress(view, Qt.MouseButton.RightButton, pos=QPoint(200, 200))
    qtbot.mouseMove(view, QPoint(200, 120))
    qtbot.mouseRelease(view, Qt.MouseButton.RightButton, pos=QPoint(200, 120))
    assert len(asked) == 1 and view.camera.position != before


def test_a_curved_membrane_is_not_stretched_and_all_axes_are_in_the_window(panel, made):
    panel.display.change(exaggeration=5.0)
    scene = panel.view.scene  # type: ignore[union-attr]
    panel.show_surface(replace(made(), curved=True, range_mm=(-2.0, 1.0)))
    assert scene.box[4:] == pytest.approx((-2.0, 1.0)) and scene.style.exaggeration == 1.0
    panel.view_from("isometric")
    ends, points, _ = scene._marks()  # type: ignore[misc]
    assert ends[:4, 2].max() == scene.box[4]  # x and y lie below the membrane
    low, high = scene._seen(points)
    assert (low > -1.0).all() and (high < 1.0).all()
    panel.show_surface(made())
    assert scene.style.exaggeration == 5.0 and scene.box[5] == pytest.approx(5.0)


def test_a_line_is_drawn_whole_on_a_curved_membrane(panel, made, heightmap, qtbot):
    panel.display.change(**PLAIN)
    curved = replace(heightmap, at_rest=MembraneShape("spherical_cap", 2.0, 18.0))
    surface = made()
    panel.show_surface(
        surface_of(curved, surface.texture, surface.scale, range_mm=(0.0, 1.0), largest=128)
    )
    panel.show_lines((SurfaceLine(((-7.0, 0.0), (7.0, 0.0)), "#ff0000"),))
    for view in ("isometric", "top"):
        panel.view_from(view)
        image = _drawn(panel, qtbot)
        red = (np.abs(image - (255, 0, 0)).max(axis=2) < 40).any(axis=0)
        columns = np.flatnonzero(red)
        assert red[columns[0] : columns[-1] + 1].mean() > 0.97 and columns.size > 200


def test_the_surface_and_its_axes_lie_beside_the_colour_bar(panel):
    scene = panel.view.scene  # type: ignore[union-attr]
    for view in VIEWS:
        panel.view_from(view)
        low, high = scene._seen(scene._marks()[0])  # type: ignore[index]
        assert -1.0 + 2.0 * BAR < low[0] and high[0] < 1.0
    panel.display.change(colour_bar=False)
    panel.view_from("top")
    low, high = scene._seen(scene._marks()[0])  # type: ignore[index]
    assert low[0] == pytest.approx(-high[0], abs=0.05)


@pytest.mark.function("Exaggerate the depth while the axes stay true")
def test_the_axes_show_true_mm_although_the_depth_is_exaggerated(panel, qtbot):
    panel.display.change(exaggeration=5.0)
    scene = panel.view.scene  # type: ignore[union-attr]
    assert scene.box[5] == pytest.approx(5.0)
    panel.view_from("isometric")
    _, points, texts = scene._marks()  # type: ignore[misc]
    titles = [texts.index(f"{name} (mm)") for name in ("x", "y", "depth")]
    x, y, depth = (
        [(float(texts[n]), points[n, axis]) for n in range(first + 1, last)]
        for axis, (first, last) in enumerate(itertools.pairwise([-1, *titles]))
    )
    assert x and all(value == pytest.approx(place) for value, place in x)
    assert y and all(value == pytest.approx(-place) for value, place in y), "y points down"
    assert depth[0][0] == 0.0 and depth[-1][0] == 1.0
    assert all(5.0 * value == pytest.approx(place) for value, place in depth)
    with_axes = _drawn(panel, qtbot)
    panel.display.change(axes=False)
    assert np.abs(with_axes.astype(int) - _drawn(panel, qtbot)).max() > 60


def test_the_colour_bar_has_the_scale_s_colours_and_ends(panel, qtbot):
    view = panel.view
    assert view is not None
    (bar,) = view.scalar_bars.values()
    assert bar.GetLookupTable().GetRange() == (0.0, 1.0)
    image = _drawn(panel, qtbot)
    strip = image[:, : image.shape[1] // 10].reshape(-1, 3).astype(float)
    for colour in colour_table("viridis")[[3, 128, 252]]:
        assert np.abs(strip - colour).max(axis=1).min() < 10


@pytest.mark.function("Clip the surface by a plane")
def test_the_clip_plane_hides_one_side_and_can_be_removed(panel, qtbot):
    panel.display.change(**PLAIN)
    panel.view_from("top")
    view = panel.view
    assert view is not None
    whole = _drawn(panel, qtbot)
    view.show_plane(True)
    view.clear_plane_widgets()  # its own lines would be in the image
    view.scene.clip_by((np.array([1.0, 0.0, 0.0]), np.zeros(3)))
    clipped = _drawn(panel, qtbot)
    kept, hidden = _screen_px(panel, *SMALL), _screen_px(panel, *BUMP)
    assert np.abs(_colour_at(clipped, kept) - _colour_at(whole, kept)).max() < 12
    assert np.abs(_colour_at(clipped, hidden) - _colour_at(whole, hidden)).max() > 40
    view.show_plane(False)
    assert view.scene.clip is None
    again = _drawn(panel, qtbot)
    assert np.abs(_colour_at(again, hidden) - _colour_at(whole, hidden)).max() < 12


def test_the_orientation_widget_has_one_size_on_every_screen(panel, qtbot):
    view = panel.view
    assert view is not None
    for height in (600, 200):
        before = view.height()
        panel.resize(500, height)
        qtbot.waitUntil(lambda before=before: view.height() != before, timeout=10_000)
        side = round(view.devicePixelRatioF() * min(120, view.height() / 2))
        assert tuple(view._orientation.GetRepresentation().GetSize()) == (side, side)


@pytest.mark.function("Look from a standard direction")
def test_a_click_on_the_orientation_widget_changes_the_view(panel, qtbot):
    panel.view_from("isometric")
    view = panel.view
    assert view is not None
    # The widget's arm towards the viewer, in the upper right corner.
    at = QPoint(view.width() - 71, 26)
    qtbot.mouseMove(view, at)
    qtbot.wait(50)
    qtbot.mouseClick(view, Qt.MouseButton.LeftButton, pos=at)

    def from_the_top() -> bool:
        x, y, z = np.subtract(view.camera.position, view.camera.focal_point)
        return abs(x) < 0.1 and abs(y) < 0.1 and z > 10.0

    qtbot.waitUntil(from_the_top, timeout=WAIT_MS)
    assert view.camera.up == pytest.approx((0.0, 1.0, 0.0), abs=1e-6)


def test_letters_of_the_view_are_of_one_kind_and_size(panel):
    panel.display.change(exaggeration=3.0)
    note, scale = panel.view.renderer.actors["note"], panel.view.scalar_bar
    letters = note.GetTextProperty(), scale.GetTitleTextProperty(), scale.GetLabelTextProperty()
    assert {one.GetFontFile() for one in letters} == {FONT}
    assert note.GetMaximumFontSize() == scale.GetLabelTextProperty().GetFontSize()


def test_the_style_is_remembered(panel, settings, qtbot):
    panel.display.change(wireframe=True, orientation=False)
    jobs = JobQueue("again")
    again = SurfacePanel(
        jobs, settings=settings, display=DisplayStore(settings), report=print, flat=flat_map
    )
    qtbot.addWidget(again)
    assert again.display.value.wireframe and not again.display.value.orientation
    jobs.close()


@pytest.mark.function(
    "Close a menu beside the 3D view and find no picture of it left, also without a compositor"
)
def test_a_3d_view_neither_rebuilds_its_window_nor_leaves_closed_menus_painted_on_it(
    settings, made, qtbot
):
    class Window(QMainWindow):
        rebuilt = 0

        def event(self, event: QEvent) -> bool:
            self.rebuilt += event.type() == QEvent.Type.WinIdChange
            return bool(super().event(event))

    jobs, window, beside = JobQueue("test"), Window(), QLabel("Beside the view")
    panel = SurfacePanel(
        jobs, settings=settings, display=DisplayStore(settings), report=print, flat=flat_map
    )
    centre = QWidget()
    hbox(beside, (panel, 1), of=centre)
    window.setCentralWidget(centre)
    window.show()
    qtbot.waitExposed(window)

    def on_screen() -> np.ndarray:
        at = beside.mapToGlobal(QPoint())
        image = QGuiApplication.primaryScreen().grabWindow(0, at.x(), at.y(), 80, 200)
        return pixels(image.toImage())

    before = window.rebuilt
    panel.show_surface(made(largest=128))
    qtbot.waitUntil(lambda: panel.view is not None and panel.view.drawings > 0, timeout=WAIT_MS)
    assert window.rebuilt == before
    clean, menu = on_screen(), QMenu(window)
    menu.addAction("An action with a long name")
    menu.popup(beside.mapToGlobal(QPoint(0, 40)))
    qtbot.waitUntil(lambda: not np.array_equal(on_screen(), clean), timeout=WAIT_MS)
    menu.close()
    qtbot.waitUntil(lambda: np.array_equal(on_screen(), clean), timeout=WAIT_MS)
    panel.finish()
    jobs.close()
    window.close()
    window.deleteLater()


def test_an_ended_view_keeps_nothing_of_its_opengl_and_is_freed(settings, made, qtbot):
    gone = []
    for _ in range(10):
        jobs = JobQueue("test")
        panel = SurfacePanel(
            jobs, settings=settings, display=DisplayStore(settings), report=print, flat=flat_map
        )
        panel.resize(200, 200)
        panel.show()
        panel.show_surface(made(largest=16))
        qtbot.waitUntil(lambda p=panel: p.view is not None and p.view.drawings > 0, timeout=WAIT_MS)
        gone.append((weakref.ref(panel.view), weakref.ref(panel.view.scene)))
        panel.finish()
        jobs.close()
        panel.close()
        panel.deleteLater()
        del panel
        qtbot.wait(5)
        # An object that Qt makes at their address later would come back to Python as one of these.
        assert not [o for o in getAllValidWrappers() if isinstance(o, QSurface | QOpenGLContext)]
    gc.collect()
    assert [alive for pair in gone for alive in pair if alive() is not None] == []


def test_until_the_3d_view_is_loaded_the_relief_is_shown_as_a_map(settings, made, qtbot):
    jobs = JobQueue("test")
    panel = SurfacePanel(
        jobs, settings=settings, display=DisplayStore(settings), report=print, flat=flat_map
    )
    qtbot.addWidget(panel)
    panel.show()
    panel.show_surface(made(largest=16))
    assert panel._flat.isVisible()
    qtbot.waitUntil(lambda: panel.view is not None and panel.view.isVisible(), timeout=WAIT_MS)
    assert panel._flat is None
    panel.finish()
    jobs.close()


@pytest.mark.function("See a shaded map where OpenGL is missing")
def test_without_opengl_the_relief_is_shown_and_the_reason(settings, made, qtbot, monkeypatch):
    monkeypatch.setattr(
        "app.views.surface.panel.opengl_problem", lambda: "OpenGL 3.2 is not available"
    )
    jobs = JobQueue("test")
    panel = SurfacePanel(
        jobs, settings=settings, display=DisplayStore(settings), report=print, flat=flat_map
    )
    qtbot.addWidget(panel)
    panel.show()
    panel.show_surface(made(largest=128))
    assert panel.view is None and "OpenGL 3.2" in panel.reason
    assert panel._flat is not None and panel._flat.isVisible()
    jobs.close()


def test_the_colour_bar_has_as_many_numbers_as_have_room(panel):
    for height, count in ((560, 5), (170, 3)):
        with closing(OffscreenScene(panel.view.scene, (640, height))) as studio:  # type: ignore[union-attr]
            studio.draw()
            (bar,) = studio._plotter.scalar_bars.values()
            assert bar.GetNumberOfLabels() == count
