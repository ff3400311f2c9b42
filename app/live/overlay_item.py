"""Draws an overlay on the image of a pyqtgraph view.

Everything is drawn at a constant width on the screen, twice: a dark line below a bright one, which
is visible on any image. Shape, dashes or text repeat what the colour means.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFontMetricsF, QImage, QPainter, QPen, QPolygonF, QTransform

from app.views.map.handles import Handle, HandleItem

from .overlay import (
    ImageOverlay,
    OverlayCircle,
    OverlayLine,
    OverlayMarker,
    OverlayMask,
    OverlayRing,
    Role,
)

# Distinguishable without red-green vision, too: the colours differ in brightness.
ROLE_COLOURS: dict[str, str] = {
    "good": "#3ddc84",
    "bad": "#ff6b5e",
    "expected": "#ffd54a",
    "led0": "#ff8a80",
    "led1": "#7dff8a",
    "led2": "#8fb4ff",
    "info": "#e8eef5",
}
HALO = QColor(0, 0, 0, 170)
RING_COLOUR = "#2a7de1"
PLATE = QColor(0, 0, 0, 150)


class OverlayItem(HandleItem):
    """Shows an overlay in image coordinates, with handles that can be dragged.

    Signals
    -------
    handle_moved(Handle)
        A drag ended.
    """

    handle_moved = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._overlay = ImageOverlay()
        self._size = (1, 1)
        self._masks: list[tuple[QRectF, QImage]] = []
        self._dragged: Handle | None = None

    def set_overlay(self, overlay: ImageOverlay, size: tuple[int, int]) -> None:
        """Show `overlay` on an image of `size` (width, height)."""
        self._size = size
        if overlay.masks != self._overlay.masks:
            self._masks = [_mask_image(mask) for mask in overlay.masks if mask.area.any()]
        # A new result must not move the handle during a drag.
        self._show(overlay if self._dragged is None else with_handle(overlay, self._dragged))

    def _show(self, overlay: ImageOverlay) -> None:
        self._overlay, self.handles = overlay, handles_of(overlay)
        self.update()

    def place(self, handle: Handle) -> Handle:
        """Show a handle at another position inside the image, and return it."""
        (u, v), (width, height) = handle.at, self._size
        centre = min(max(u, 0.0), width - 1.0), min(max(v, 0.0), height - 1.0)
        handle = replace(handle, at=centre)
        self._show(with_handle(self._overlay, handle))
        return handle

    def on_grab(self, handle: Handle) -> None:
        """Select a handle."""
        self.select(handle.name)

    def on_drag(self, handle: Handle, *, ended: bool) -> None:
        """Move or resize a handle, and report it at the end of the drag."""
        placed = self.place(handle)
        self._dragged = None if ended else placed
        if ended:
            self.handle_moved.emit(placed)

    def paint(self, painter: QPainter, *_: Any) -> None:  # noqa: D102
        for position, image in self._masks:
            painter.drawImage(position, image)
        to_screen = painter.worldTransform()
        painter.save()
        painter.resetTransform()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for line in self._overlay.lines:
            _paint_line(painter, line, to_screen)
        for circle in self._overlay.circles:
            _paint_circle(painter, circle, to_screen, circle.handle == self.selected)
        for ring in self._overlay.rings:
            _paint_ring(painter, ring, to_screen)
        for marker in self._overlay.markers:
            _paint_marker(painter, marker, to_screen, marker.handle == self.selected)
        painter.restore()


def handles_of(overlay: ImageOverlay) -> tuple[Handle, ...]:
    """Return what can be dragged, in the order of the keyboard."""
    circles = (Handle(c.handle, (c.u, c.v), c.radius_px) for c in overlay.circles if c.handle)
    return (*circles, *(Handle(m.handle, (m.u, m.v)) for m in overlay.markers if m.handle))


def with_handle(overlay: ImageOverlay, handle: Handle) -> ImageOverlay:
    """Return an overlay with the item of that name moved to the handle."""
    name, (u, v), radius_px = handle.name, handle.at, handle.radius
    return replace(
        overlay,
        markers=tuple(replace(m, u=u, v=v) if m.handle == name else m for m in overlay.markers),
        circles=tuple(
            replace(c, u=u, v=v, radius_px=radius_px) if c.handle == name else c
            for c in overlay.circles
        ),
    )


def colour_of(role: str) -> QColor:
    """Return the colour of a role. Any other text is a colour itself."""
    return QColor(ROLE_COLOURS.get(role, role))


def _mask_image(mask: OverlayMask) -> tuple[QRectF, QImage]:
    """Return the tint of a mask, one byte per pixel with a colour table, with its position.

    It covers only these pixels: a few small spots would otherwise cost several times as much per
    frame as the whole image.
    """
    left, top, columns, rows = cv2.boundingRect(np.ascontiguousarray(mask.area).view(np.uint8))
    # Qt requires every line to begin at a multiple of four bytes.
    padded = np.zeros((rows, -(-columns // 4) * 4), np.uint8)
    padded[:, :columns] = mask.area[top : top + rows, left : left + columns]
    image = QImage(padded.data, columns, rows, padded.shape[1], QImage.Format.Format_Indexed8)
    tint = colour_of(mask.role)
    tint.setAlpha(95)
    image.setColorTable([0, tint.rgba()])
    return QRectF(left - 0.5, top - 0.5, columns, rows), image.copy()


def stroke(painter: QPainter, role: str, draw: Any, *, width: float = 1.6) -> None:
    """Draw twice: a dark halo, then the colour of a role. Expected items are dashed."""
    dashed = Qt.PenStyle.DashLine if role == "expected" else Qt.PenStyle.SolidLine
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for pen in (QPen(HALO, width + 2.0), QPen(colour_of(role), width, dashed)):
        painter.setPen(pen)
        draw()


def _paint_line(painter: QPainter, line: OverlayLine, to_screen: QTransform) -> None:
    polygon = to_screen.map(QPolygonF([QPointF(u, v) for u, v in line.points]))
    draw = painter.drawPolygon if line.closed else painter.drawPolyline
    # Information stays thin: there may be a dozen earlier views.
    if line.role == "info":
        painter.setBrush(Qt.BrushStyle.NoBrush)
        faint = colour_of("info")
        faint.setAlpha(120)
        painter.setPen(QPen(faint, 1.0))
        draw(polygon)
        return
    stroke(painter, line.role, lambda: draw(polygon))


def _paint_circle(
    painter: QPainter, circle: OverlayCircle, to_screen: QTransform, selected: bool
) -> None:
    centre = to_screen.map(QPointF(circle.u, circle.v))
    edge = to_screen.map(QPointF(circle.u + circle.radius_px, circle.v))
    radius = abs(edge.x() - centre.x())
    stroke(painter, circle.role, lambda: painter.drawEllipse(centre, radius, radius))
    if circle.handle:
        paint_grip(painter, centre, circle.role, selected)
        paint_grip(painter, edge, circle.role, selected)


def _paint_ring(painter: QPainter, ring: OverlayRing, to_screen: QTransform) -> None:
    centre = to_screen.map(QPointF(ring.u, ring.v))
    edge = to_screen.map(QPointF(ring.u + ring.radius_px, ring.v))
    radius = abs(edge.x() - centre.x())
    box = QRectF(centre.x() - radius, centre.y() - radius, 2 * radius, 2 * radius)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for colour, fraction in ((HALO, 1.0), (QColor(RING_COLOUR), ring.share)):
        pen = QPen(colour, 6.0)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        painter.setPen(pen)
        painter.drawArc(box, 90 * 16, round(-360 * 16 * fraction))


def paint_grip(painter: QPainter, at: QPointF, role: str, selected: bool) -> None:
    """Draw a handle. The selected one, which the keys move, is larger."""
    size = 4.0 + (2.0 if selected else 0.0)
    box = QRectF(at.x() - size, at.y() - size, 2 * size, 2 * size)
    painter.setPen(QPen(QColor(0, 0, 0), 1.0))
    painter.setBrush(QColor("white") if selected else colour_of(role))
    painter.drawRect(box)


def _paint_marker(
    painter: QPainter, marker: OverlayMarker, to_screen: QTransform, selected: bool
) -> None:
    centre = to_screen.map(QPointF(marker.u, marker.v))
    x, y, size = centre.x(), centre.y(), 7.0

    def draw() -> None:
        match marker.kind:
            case "cross":
                painter.drawLine(QPointF(x - size, y - size), QPointF(x + size, y + size))
                painter.drawLine(QPointF(x - size, y + size), QPointF(x + size, y - size))
            case "plus":
                painter.drawLine(QPointF(x - size, y), QPointF(x + size, y))
                painter.drawLine(QPointF(x, y - size), QPointF(x, y + size))
            case "ring":
                painter.drawEllipse(centre, size, size)
            case "dot":
                painter.drawEllipse(centre, 2.0, 2.0)

    stroke(painter, marker.role, draw)
    if marker.handle:
        ring = size + 5.0
        stroke(
            painter,
            "info" if selected else marker.role,
            lambda: painter.drawRect(QRectF(x - ring, y - ring, 2 * ring, 2 * ring)),
            width=2.4 if selected else 1.0,
        )
    if marker.text:
        # Expected items are close to the found ones: their texts must not overlap.
        text_place = QPointF(x, y + size + 6.0 if marker.role == "expected" else y - size)
        _paint_text(painter, text_place, marker.text, marker.role, gap=size + 5.0)


def _paint_text(painter: QPainter, at: QPointF, text: str, role: Role, *, gap: float = 0.0) -> None:
    """Write on a dark plate, `gap` to the right of a point, or to its left at the view's edge."""
    metrics = QFontMetricsF(painter.font())
    width, height = metrics.horizontalAdvance(text) + 8.0, metrics.height() + 2.0
    view = QRectF(painter.window())
    left, top = at.x() + gap, at.y() - height / 2
    if left + width > view.right():
        left = at.x() - gap - width
    top = min(max(top, 0.0), view.bottom() - height)
    paint_plate(painter, QRectF(left, top, width, height), text, role)


def paint_plate(painter: QPainter, plate: QRectF, text: str, role: str) -> None:
    """Write on a dark plate."""
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(PLATE)
    painter.drawRoundedRect(plate, 3.0, 3.0)
    painter.setPen(colour_of(role))
    painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, text)
