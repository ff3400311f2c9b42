"""Images of cameras as pixmaps of Qt."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from PySide6.QtGui import QImage, QPixmap

if TYPE_CHECKING:
    from numpy.typing import NDArray


def pixmap_of(rgb: NDArray[Any]) -> QPixmap:
    """Return an image (rows, columns, 3) of 8 or 16 bits as a pixmap of its size."""
    pixels = (rgb if rgb.dtype.itemsize == 1 else rgb >> 8).astype("uint8", order="C")
    rows, columns = pixels.shape[:2]
    image = QImage(pixels.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
    return QPixmap.fromImage(image)
