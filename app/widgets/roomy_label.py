"""A label of several lines that keeps its height when its text changes."""

from __future__ import annotations

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtWidgets import QWidget

from app.widgets.label import PlainLabel

HIGH = 10_000


class RoomyLabel(PlainLabel):
    """Plain text, wrapped, with space for the longest of several texts.

    Parameters
    ----------
    *texts : str
        The texts that it may show. Default: space for one line.
    """

    def __init__(self, *texts: str, parent: QWidget | None = None) -> None:
        super().__init__(parent=parent)
        self._texts = texts or (" ",)
        self.setWordWrap(True)
        self.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)

    def hasHeightForWidth(self) -> bool:
        """Whether the height depends on the width, also while there is no text."""
        return True

    def heightForWidth(self, width: int) -> int:
        """Return the height of the longest text, or of the current one if that is higher."""
        metrics, wrap = self.fontMetrics(), Qt.TextFlag.TextWordWrap
        area = QRect(0, 0, width, HIGH)
        texts = (*self._texts, self.text())
        return max(metrics.boundingRect(area, wrap, text).height() for text in texts)

    def minimumSizeHint(self) -> QSize:
        """Return a size that leaves the width to other widgets."""
        return QSize(0, self.fontMetrics().lineSpacing())
