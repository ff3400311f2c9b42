"""The surface in 3D, turned by the mouse or the keys; drawn when it is painted, once."""

from __future__ import annotations

import math

import numpy as np
from PySide6.QtCore import QEvent, QPointF, Qt, QTimer, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from app.inspect.camera3d import PRESETS, Camera
from app.inspect.draped import DrapedLine, draw_line
from app.inspect.scale_bar import draw_bar, length_text, round_length_mm
from app.inspect.scene3d import Scene
from app.inspect.surface import LIVE_NODES, Surface
from app.shell import theme
from app.widgets.naming import named
from gelpolight_core.translation import tr

DEGREES_PER_PX = 0.4
KEY_DEG = 6.0
ZOOM_STEP = 1.15
SETTLE_MS = 250
CURSOR = QColor(255, 255, 255)
AXIS_PX = 26.0


class SurfaceView(QWidget):
    """Shows the surface.

    Attributes
    ----------
    drawings : int
        How often the scene was drawn.

    Signals
    -------
    pointed(float, float)
        Place (x, y) under the pointer, mm; NaN where there is none.
    moved()
        The camera was moved by hand.

    Raises
    ------
    InputError
        Where this machine cannot draw in 3D.
    """

    pointed = Signal(float, float)
    moved = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(
            self,
            "inspect.surface.view",
            tr("Surface in 3D"),
        )
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.setMouseTracking(True)
        self.setMinimumSize(160, 120)
        self.drawings = 0
        self.camera = Camera()
        self.exaggeration = 1.0
        self._scene = Scene()
        self._surface: Surface | None = None
        self._cursor: tuple[float, float] | None = None
        self._lines: tuple[DrapedLine, ...] = ()
        self._picture: QImage | None = None
        self._stale = True
        self._fitted = True
        self._held: QPointF | None = None
        self._settle = QTimer(self)
        self._settle.setSingleShot(True)
        self._settle.setInterval(SETTLE_MS)
        self._settle.timeout.connect(self._show_all_nodes)
        self._take_theme()

    # What the panel asks

    def show_surface(self, surface: Surface) -> None:
        """Show the surface of a frame."""
        first = self._surface is None
        self._surface = surface
        self._settle.stop()
        self._scene.surface.show(surface)
        if first:
            self.fit()
        self._draw_anew()

    def set_exaggeration(self, factor: float) -> None:
        """Stretch the depth."""
        self.exaggeration = factor
        self._draw_anew()

    def look_from(self, preset: str) -> None:
        """Look from one of PRESETS, at all of it."""
        self.camera = self.camera.seen_from(*PRESETS[preset])
        self.fit()

    def fit(self) -> None:
        """Show all of the surface."""
        self._fitted = True
        if self._surface is not None:
            left, top, right, bottom = self._surface.extent_mm
            radius = 0.5 * max(right - left, bottom - top)
            self.camera = self.camera.fitted(radius, (self.width(), self.height()))
        self._draw_anew()

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a place; NaN: none."""
        there = math.isfinite(x_mm) and math.isfinite(y_mm)
        cursor = (x_mm, y_mm) if there else None
        if cursor != self._cursor:
            self._cursor = cursor
            self.update()

    def show_lines(self, lines: tuple[DrapedLine, ...]) -> None:
        """Lay lines on the surface in the place of those that are there."""
        if lines != self._lines:
            self._lines = lines
            self.update()

    def picture(self, width: int, height: int) -> QImage:
        """Return a picture of the surface in any size, without marks."""
        drawn = self._scene.draw(self.camera, (width, height), self.exaggeration)
        self._stale = True
        image = QImage(drawn.data, width, height, 3 * width, QImage.Format.Format_RGB888)
        return image.copy()

    def finish(self) -> None:
        """Give the graphics memory back."""
        self._settle.stop()
        self._scene.close()

    def place_at(self, across: float, down: float) -> tuple[float, float] | None:
        """Return the place (x, y) of the sensor that is seen at a point of this widget."""
        if self._surface is None:
            return None
        start, along = self.camera.ray(across, down, (self.width(), self.height()))
        if along[2] > -1e-3:
            return None
        # From above all depths downwards, until the ray is below the surface.
        highest = self.exaggeration * max(float(self._surface.depth_mm.max()), 0.0)
        t = np.linspace((highest - start[2]) / along[2], (-0.2 - start[2]) / along[2], 200)
        points = start + t[:, None] * along
        heights = self.exaggeration * self._surface.depth_at(points[:, 0], -points[:, 1])
        below = np.flatnonzero(points[:, 2] <= heights)
        if below.size == 0:
            return None
        x, y, _ = points[below[0]]
        return float(x), float(-y)

    # Drawing

    def _draw_anew(self) -> None:
        self._stale = True
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        if self._surface is None:
            painter.fillRect(self.rect(), self.palette().window())
            painter.end()
            return
        if self._stale:
            self._stale = False
            ratio = self.devicePixelRatioF()
            width, height = round(self.width() * ratio), round(self.height() * ratio)
            drawn = self._scene.draw(self.camera, (width, height), self.exaggeration)
            self.drawings += 1
            self._kept = drawn  # the image below only looks at it
            self._picture = QImage(
                drawn.data, width, height, 3 * width, QImage.Format.Format_RGB888
            )
        assert self._picture is not None
        painter.drawImage(self.rect(), self._picture)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for line in self._lines:
            size = (self.width(), self.height())
            draw_line(painter, line, self._surface, self.camera, size, self.exaggeration)
        self._draw_cursor(painter)
        self._draw_scale(painter)
        painter.end()

    def _draw_cursor(self, painter: QPainter) -> None:
        if self._cursor is None:
            return
        x, y = self._cursor
        assert self._surface is not None
        depth = float(self._surface.depth_at(np.array([x]), np.array([y]))[0])
        height = self.exaggeration * depth
        if not math.isfinite(height):
            return
        at = self._project((x, -y, height))
        for colour, width in ((QColor(0, 0, 0, 160), 3.5), (CURSOR, 1.5)):
            painter.setPen(QPen(colour, width))
            painter.drawEllipse(at, 5.0, 5.0)
            painter.drawLine(at + QPointF(0.0, -5.0), at + QPointF(0.0, -22.0))

    def _draw_scale(self, painter: QPainter) -> None:
        """Draw where x and y lie, and a length in the middle of the view."""
        height = max(self.height(), 1)
        start = QPointF(12.0 + AXIS_PX, height - 40.0 - AXIS_PX)
        for axis, x, y in (("x", 1.0, 0.0), ("y", 0.0, -1.0)):
            # As the sensor's frame: its y points down in the picture from above.
            along = np.array([x, y, 0.0])
            way = AXIS_PX * QPointF(
                float(along @ self.camera.right()), -float(along @ self.camera.up())
            )
            painter.setPen(QPen(theme.colour("muted"), 1.6))
            painter.drawLine(start, start + way)
            painter.drawText(start + 1.25 * way + QPointF(-4.0, 4.0), axis)
        scale = self.camera.mm_per_px(height)
        bar = round_length_mm(0.2 * self.width() * scale)
        px, base = bar / scale, height - 12.0
        text = length_text(bar)
        if self.exaggeration != 1.0:
            text += tr(",  depth x {k:g}").format(k=self.exaggeration)
        draw_bar(
            painter,
            QPointF(10.0, base),
            QPointF(10.0 + px, base),
            text,
            ink=theme.colour("text"),
            halo=theme.colour("window"),
        )

    def _project(self, point: tuple[float, float, float]) -> QPointF:
        at = self.camera.project(np.array([point]), (self.width(), self.height()))[0]
        return QPointF(float(at[0]), float(at[1]))

    def _take_theme(self) -> None:
        ends = ("base", "button") if theme.is_dark() else ("alternate", "base")
        low, high = (theme.colour(name) for name in ends)
        self._scene.set_background(low.getRgbF()[:3], high.getRgbF()[:3])
        self._draw_anew()

    # Hands

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        self._held = event.position()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        at = event.position()
        if self._held is None or event.buttons() == Qt.MouseButton.NoButton:
            place = self.place_at(at.x(), at.y())
            self.pointed.emit(*(place or (math.nan, math.nan)))
            return
        moved, self._held = at - self._held, at
        shift = event.modifiers() & Qt.KeyboardModifier.ShiftModifier
        if event.buttons() & Qt.MouseButton.LeftButton and not shift:
            self._move(self.camera.turned(-DEGREES_PER_PX * moved.x(), DEGREES_PER_PX * moved.y()))
        else:
            self._move(self.camera.panned(moved.x(), moved.y(), self.height()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        self._held = None

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        self.fit()

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102
        self._move(self.camera.zoomed(ZOOM_STEP ** (event.angleDelta().y() / 120.0)))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        key = Qt.Key
        turns = {
            key.Key_Left: (-KEY_DEG, 0.0),
            key.Key_Right: (KEY_DEG, 0.0),
            key.Key_Up: (0.0, KEY_DEG),
            key.Key_Down: (0.0, -KEY_DEG),
        }
        if event.key() in turns:
            self._move(self.camera.turned(*turns[key(event.key())]))
        elif event.key() in (key.Key_Plus, key.Key_Equal, key.Key_Minus):
            step = 1.0 / ZOOM_STEP if event.key() == key.Key_Minus else ZOOM_STEP
            self._move(self.camera.zoomed(step))
        else:
            super().keyPressEvent(event)

    def _move(self, camera: Camera) -> None:
        self._fitted = False
        if self._surface is not None and max(self._surface.depth_mm.shape) > 2 * LIVE_NODES:
            # All nodes of a standing picture could not follow the hand.
            if not self._settle.isActive():
                self._scene.surface.show(self._surface.thinned(LIVE_NODES))
            self._settle.start()
        self.camera = camera
        self._draw_anew()
        self.moved.emit()

    def _show_all_nodes(self) -> None:
        if self._surface is not None:
            self._scene.surface.show(self._surface)
            self._draw_anew()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        super().resizeEvent(event)
        if self._fitted:
            self.fit()
        self._draw_anew()

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102
        super().leaveEvent(event)
        self.pointed.emit(math.nan, math.nan)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_scene"):
            self._take_theme()
