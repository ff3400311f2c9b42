"""The icons of the image tools, drawn in the colour of the text."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPainterPath, QPen, QPixmap

SIDE = 20


def tool_icon(name: str, colour: QColor, *, ratio: float = 2.0) -> QIcon:
    """Return an icon.

    Parameters
    ----------
    name : str
        One of ``ICONS``.
    colour : QColor
        Colour of the text, so that the icon follows the theme.
    ratio : float, optional
        Screen pixels per point.
    """
    pixmap = QPixmap(round(SIDE * ratio), round(SIDE * ratio))
    pixmap.setDevicePixelRatio(ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    pen = QPen(colour, 1.6)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    ICONS[name](painter)
    painter.end()
    return QIcon(pixmap)


def _lines(painter: QPainter, *strokes: tuple[tuple[float, float], ...]) -> None:
    for stroke in strokes:
        painter.drawPolyline([QPointF(x, y) for x, y in stroke])


def _fit(painter: QPainter) -> None:
    corners = [((3, 7), (3, 3), (7, 3)), ((13, 3), (17, 3), (17, 7))]
    corners += [((17, 13), (17, 17), (13, 17)), ((7, 17), (3, 17), (3, 13))]
    _lines(painter, *corners)
    painter.drawRect(QRectF(7, 7.5, 6, 5))


def _full_size(painter: QPainter) -> None:
    _lines(painter, ((4, 7), (6, 5), (6, 15)), ((14, 7), (16, 5), (16, 15)))
    painter.drawPoint(QPointF(11, 8))
    painter.drawPoint(QPointF(11, 13))


def _freeze(painter: QPainter) -> None:
    painter.fillRect(QRectF(5, 4, 3.5, 12), painter.pen().color())
    painter.fillRect(QRectF(11.5, 4, 3.5, 12), painter.pen().color())


def _snapshot(painter: QPainter) -> None:
    body = QPainterPath()
    body.addRoundedRect(QRectF(2.5, 6, 15, 10.5), 2, 2)
    painter.drawPath(body)
    painter.drawEllipse(QPointF(10, 11.2), 3, 3)
    _lines(painter, ((7, 6), (8.2, 3.5), (11.8, 3.5), (13, 6)))


def _zebra(painter: QPainter) -> None:
    painter.drawRect(QRectF(3, 3, 14, 14))
    _lines(painter, ((3, 9), (9, 3)), ((3, 15), (15, 3)), ((7, 17), (17, 7)), ((13, 17), (17, 13)))


def _histogram(painter: QPainter) -> None:
    _lines(painter, ((3, 3), (3, 17), (17, 17)))
    for x, top in ((6.5, 12.0), (10.0, 6.0), (13.5, 9.0)):
        painter.fillRect(QRectF(x - 1.2, top, 2.6, 16 - top), painter.pen().color())


def _overlay(painter: QPainter) -> None:
    painter.drawEllipse(QPointF(10, 10), 6, 6)
    _lines(painter, ((10, 1.5), (10, 7)), ((10, 13), (10, 18.5)))
    _lines(painter, ((1.5, 10), (7, 10)), ((13, 10), (18.5, 10)))


ICONS: dict[str, Callable[[QPainter], None]] = {
    "fit": _fit,
    "full_size": _full_size,
    "freeze": _freeze,
    "snapshot": _snapshot,
    "zebra": _zebra,
    "histogram": _histogram,
    "overlay": _overlay,
}
