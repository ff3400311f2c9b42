"""Icons in the colours of the theme, and images as pixmaps."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QByteArray, QPoint, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QIconEngine, QImage, QPainter, QPalette, QPixmap
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QApplication

from app.widgets import theme

if TYPE_CHECKING:
    from numpy.typing import NDArray


def pixmap_of(rgb: NDArray[Any]) -> QPixmap:
    """Return an image (rows, columns, 3) of 8 or 16 bits as a pixmap of its size."""
    pixels = (rgb if rgb.dtype.itemsize == 1 else rgb >> 8).astype("uint8", order="C")
    rows, columns = pixels.shape[:2]
    image = QImage(pixels.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
    return QPixmap.fromImage(image)


FOLDER = Path(__file__).resolve().parents[2] / "resources" / "icons"


def icon(name: str, role: str = "") -> QIcon:
    """Return an icon that follows the theme by itself.

    Parameters
    ----------
    name : str
        A file of ``resources/icons``, without its extension.
    role : str, optional
        A colour of :func:`app.widgets.theme.colour`. Default: the text colour.
    """
    return QIcon(_kept(_SvgIconEngine(name, role)))


def tool_icon(tool: str) -> str:
    """Return the name of the icon of a measuring tool, a common one if it has none of its own."""
    name = f"tool-{tool}"
    return name if (FOLDER / f"{name}.svg").is_file() else "measure"


def application_icon() -> QIcon:
    """Return the program's own icon, in its own colours."""
    result = QIcon()
    renderer = QSvgRenderer(str(FOLDER / "gelpolight.svg"))
    for side in (16, 24, 32, 48, 64, 128, 256):
        result.addPixmap(painted(QSize(side, side), renderer.render))
    return result


def painted(size: QSize, paint: Callable[[QPainter], object]) -> QPixmap:
    """Return a transparent pixmap with what a function paints."""
    pixmap = QPixmap(size)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    paint(painter)
    painter.end()
    return pixmap


def _kept(engine: _SvgIconEngine) -> _SvgIconEngine:
    """Leave the deletion of an engine to Qt.

    PySide assumes that Python owns it, and would delete it with its last reference while an icon
    still uses it. One extra reference prevents this, also when the program ends.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(engine))
    return engine


@cache
def _svg(name: str) -> str:
    return (FOLDER / f"{name}.svg").read_text("utf-8")


@cache
def _renderer(name: str, colour: str) -> QSvgRenderer:
    return QSvgRenderer(QByteArray(_svg(name).replace("currentColor", colour).encode()))


class _SvgIconEngine(QIconEngine):
    """Paints an SVG in a colour that is read at each painting."""

    def __init__(self, name: str, role: str) -> None:
        super().__init__()
        self._name = name
        self._role = role
        _svg(name)  # report a missing file here, not while painting

    def clone(self) -> QIconEngine:
        """Return a copy. Qt asks for one when an icon is modified."""
        return _kept(_SvgIconEngine(self._name, self._role))

    def _colour(self, mode: QIcon.Mode) -> QColor:
        palette = QApplication.palette()
        if mode is QIcon.Mode.Disabled:
            return palette.color(QPalette.ColorGroup.Disabled, QPalette.ColorRole.Text)
        if mode is QIcon.Mode.Selected:
            return palette.color(QPalette.ColorRole.HighlightedText)
        if self._role:
            return theme.colour(self._role)
        return palette.color(QPalette.ColorRole.WindowText)

    def paint(self, painter: QPainter, rect: QRect, mode: QIcon.Mode, state: QIcon.State) -> None:
        """Draw into a square in the middle of `rect`."""
        side = min(rect.width(), rect.height())
        x = rect.x() + (rect.width() - side) / 2
        y = rect.y() + (rect.height() - side) / 2
        _renderer(self._name, self._colour(mode).name()).render(painter, QRectF(x, y, side, side))

    def pixmap(self, size: QSize, mode: QIcon.Mode, state: QIcon.State) -> QPixmap:
        """Return an image of the icon."""
        if size.isEmpty():
            return QPixmap()
        area = QRect(QPoint(0, 0), size)
        return painted(size, lambda painter: self.paint(painter, area, mode, state))
