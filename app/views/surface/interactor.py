"""The 3D view as a widget: pyvistaqt's interactor with one rendering per paint event, and picking.

Left drag rotates, Shift and left drag or the middle button pans, wheel and right drag zoom, as in
pyvista and ParaView. A left click without a drag sets a pin, a right click requests the menu.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from PySide6.QtCore import QEvent, QLoggingCategory, QPoint, QPointF, Qt, Signal
from PySide6.QtGui import QCloseEvent, QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QGestureEvent, QPinchGesture
from pyvistaqt import QtInteractor
from vtkmodules.vtkRenderingCore import vtkPropCollection

from app.program.display import DisplaySettings
from app.widgets import theme
from app.widgets.keys import ARROWS, ZOOMS
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PointXY

from .display_surface import DisplaySurface, intersect_ray
from .overlays import CUT, SceneColours
from .scene import Scene

KEY_DEG = 6.0
KEY_ZOOM = 1.15
TO_VIEWER = 0.0, -1.0, 0.0
"""Normal of the clip plane at first."""
ORIENTATION_PX = 120  # but at most half of the view


class Interactor(QtInteractor):  # type: ignore[misc]
    """Shows a scene, controlled by mouse, touchpad and keys.

    Attributes
    ----------
    scene : Scene
        Content. Call ``update`` after a change.
    drawings : int
        Number of renderings.

    Signals
    -------
    pointed(float, float)
        Position (x, y) under the pointer, mm. NaN if there is none.
    clicked(float, float)
        Position of a click.
    menu_wanted(QPoint)
        Position in this widget where the menu was requested.
    """

    pointed = Signal(float, float)
    clicked = Signal(float, float)
    menu_wanted = Signal(QPoint)

    def __init__(self) -> None:
        # pyvistaqt sets the default OpenGL format, which is already set. Qt would warn of it.
        QLoggingCategory.setFilterRules("default.warning=false")
        super().__init__(None, multi_samples=0, auto_update=False, lighting="none")
        QLoggingCategory.setFilterRules("")
        set_names(self, "view3d.surface", "Surface in 3D")
        self.setAcceptDrops(False)  # the window opens dropped files
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.setMinimumSize(160, 120)
        self.grabGesture(Qt.GestureType.PinchGesture)
        self.suppress_rendering = True  # only Qt's paint events draw
        self.drawings = 0
        self._pressed: QPointF | None = None
        self._fitted = True
        self._still = self._polished = False
        self._finished = False
        # VTK draws only inside a paint event. At any other time its request becomes a paint event.
        self.iren.interactor.EnableRenderOff()
        self._observed = [
            (self.iren.interactor, self.iren.interactor.AddObserver("RenderEvent", self._on_render))
        ]
        style = self.iren.interactor.GetInteractorStyle()
        slots = {"StartInteractionEvent": self._on_hand, "EndInteractionEvent": self._on_hand_off}
        for event, slot in slots.items():
            self._observed.append((style, style.AddObserver(event, slot)))
        self.scene = Scene(self)
        self._orientation = self._add_orientation()
        self._plane: object | None = None
        self._settle = timer(self, 250, self._refine, once=True)
        self._follow_theme()

    # Called by the panel

    def show_surface(self, surface: DisplaySurface, *, still: bool = False) -> None:
        """Show the surface of a frame. One that stays gets smooth edges."""
        self._settle.stop()
        self._polish(False)
        self.scene.show_surface(surface)
        self._still = still
        if still:
            self._settle.start()
        self.update()

    def view_from(self, view: str) -> None:
        """View the whole surface from one of VIEWS, or from the current direction (``fit``)."""
        self._fitted = True
        if view == "fit":
            self.scene.fit()
        else:
            self.scene.view_from(view)
        self.update()

    def set_style(self, style: DisplaySettings) -> None:
        """Show or hide the axes and other parts of the style."""
        self.scene.set_style(style)
        self._orientation.SetEnabled(style.orientation)
        self.update()

    def show_plane(self, on: bool) -> None:
        """Show a draggable plane, and hide what is in front of it."""
        if on == (self._plane is not None):
            return
        if not on:
            self.clear_plane_widgets()
            self._plane = None
            self.scene.clip_by(None)
        else:
            if not self.scene.box:
                return
            left, right, low, high, under, over = self.scene.box
            middle = (0.5 * (left + right), 0.5 * (low + high), 0.5 * (under + over))
            tall = (left, right, low, high, min(under, 0.0), max(over, 0.15 * (right - left)))
            how = {"origin": middle, "bounds": tall, "color": CUT, "test_callback": False}
            self._plane = self.add_plane_widget(self._on_plane, normal=TO_VIEWER, **how)
            self._on_plane(TO_VIEWER, middle)
        self.update()

    def finish(self) -> None:
        """Release the graphics memory."""
        if self._finished:
            return
        self._finished = True
        self.setUpdatesEnabled(False)
        self._settle.stop()
        for subject, tag in self._observed:
            subject.RemoveObserver(tag)
        self._observed.clear()
        self._orientation.SetEnabled(False)
        self.clear_plane_widgets()
        self.close()

    def point_at(self, at: QPointF) -> PointXY | None:
        """Return the position (x, y) in the sensor frame at a point of this widget."""
        surface = self.scene.surface
        if surface is None:
            return None
        ratio = self.devicePixelRatioF()
        across, up = ratio * at.x(), ratio * (self.height() - 1 - at.y())
        ends = []
        for depth in (0.0, 1.0):
            self.renderer.SetDisplayPoint(across, up, depth)
            self.renderer.DisplayToWorld()
            x, y, z, w = self.renderer.GetWorldPoint()
            ends.append(np.array([x, -y, z / self.scene.style.exaggeration]) / w)
        return intersect_ray(surface, *ends)

    # VTK's events

    def resizeGL(self, width: int, height: int) -> None:
        """Keep the whole surface visible until the user moves the camera."""
        if self._finished:
            return
        super().resizeGL(width, height)
        side = round(self.devicePixelRatioF() * min(ORIENTATION_PX, self.height() / 2))
        self._orientation.GetRepresentation().SetSize(side, side)
        self._orientation.SquareResize()
        if self._fitted:
            self.scene.fit()

    def paintGL(self) -> None:
        """Draw the scene once, unless its graphics memory is released."""
        window = self.render_window
        if self._finished or not window.GetReadyForRendering():
            return
        self.drawings += 1
        self._in_paint = True
        try:
            window.GetState().Reset()  # Qt has drawn since
            self.scene.lay_axes()
            # The interactor would hold Python's lock while it draws, and every other thread.
            window.Render()
        finally:
            self._in_paint = False
        super().paintGL()  # copies the image into the widget

    def _on_render(self, *_: object) -> None:
        if not self._in_paint:
            self.update()

    def _on_hand(self, *_: object) -> None:
        self._fitted = False
        self._settle.stop()
        self._polish(False)
        self.scene.coarsen()

    def _on_hand_off(self, *_: object) -> None:
        self._settle.start()

    def _refine(self) -> None:
        self.scene.refine()
        self._polish(self._still)
        self.update()

    def _polish(self, on: bool) -> None:
        """Draw smooth edges, which takes too long for live images."""
        if on != self._polished:
            self._polished = on
            self.enable_anti_aliasing("fxaa") if on else self.disable_anti_aliasing()

    def _on_plane(self, normal: object, origin: object) -> None:
        self.scene.clip_by((np.asarray(normal, float), np.asarray(origin, float)))
        self.update()

    def _add_orientation(self) -> Any:
        widget = self.add_camera_orientation_widget()
        representation = widget.GetRepresentation()
        # The scene's y axis points up, the sensor's down. z is depth.
        ends = "XPlus", "XMinus", "YPlus", "YMinus", "ZPlus", "ZMinus"
        for end, text in zip(ends, ("x", "-x", "-y", "y", "top", "bottom"), strict=True):
            getattr(representation, f"Set{end}LabelText")(text)
        parts = vtkPropCollection()
        representation.GetActors(parts)
        for number in range(parts.GetNumberOfItems()):
            # Lighting them would cost a software renderer a tenth of each frame.
            parts.GetItemAsObject(number).GetProperty().LightingOff()
        return widget

    # Mouse and keys

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Store the start of a click or a drag."""
        self._pressed = event.position()
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Emit the position under the pointer, except during a drag."""
        super().mouseMoveEvent(event)
        if event.buttons() == Qt.MouseButton.NoButton:
            point = self.point_at(event.position())
            self.pointed.emit(*(point or (math.nan, math.nan)))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Treat a press without a drag as a click."""
        super().mouseReleaseEvent(event)
        pressed, self._pressed = self._pressed, None
        if pressed is None or (event.position() - pressed).manhattanLength() > 4.0:
            return
        if event.button() == Qt.MouseButton.RightButton:
            self.menu_wanted.emit(event.position().toPoint())
        elif event.button() == Qt.MouseButton.LeftButton and not event.modifiers():
            point = self.point_at(event.position())
            if point is not None:
                self.clicked.emit(*point)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Show everything. The second release of a double click is not a click."""
        self._pressed = None
        self.view_from("fit")

    def leaveEvent(self, event: QEvent) -> None:
        """Report that the pointer has left."""
        super().leaveEvent(event)
        self.pointed.emit(math.nan, math.nan)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Rotate with the arrow keys and zoom with plus and minus. Pass on all other keys."""
        key = Qt.Key(event.key())
        if key in ARROWS:
            right, down = ARROWS[key]
            self.camera.Azimuth(-KEY_DEG * right)
            self.camera.Elevation(KEY_DEG * down)
            self.camera.OrthogonalizeViewUp()
        elif key in ZOOMS:
            self.scene.zoom(KEY_ZOOM ** ZOOMS[key])
        else:
            event.ignore()
            return
        self.renderer.ResetCameraClippingRange()
        self.update()

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        """Ignore VTK's own keys: they would exit or change the view without updating the menu."""
        event.ignore()

    def event(self, event: QEvent) -> bool:
        """Zoom with a pinch on a touchpad."""
        if isinstance(event, QGestureEvent):
            pinch = event.gesture(Qt.GestureType.PinchGesture)
            if isinstance(pinch, QPinchGesture):
                self.scene.zoom(pinch.scaleFactor())
                self.update()
                return True
        return bool(super().event(event))

    def closeEvent(self, event: QCloseEvent) -> None:
        """Stop drawing when VTK's window is closed."""
        self._finished = True
        super().closeEvent(event)
        # Qt deletes both without a word to Python, and a new object at their address would come
        # back as the old surface.
        self._forget_context()

    # Theme

    def changeEvent(self, event: QEvent) -> None:
        """Follow the program's theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "scene"):
            self._follow_theme()

    def _follow_theme(self) -> None:
        low, high = ("base", "button") if theme.is_dark() else ("alternate", "base")
        below, above, text = (theme.colour(name).name() for name in (low, high, "text"))
        self.scene.set_ink(SceneColours(below, above, text))
        self.update()
