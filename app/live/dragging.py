"""Items of a view whose parts are clicked and dragged with the left button."""

from __future__ import annotations

from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt

LEFT = Qt.MouseButton.LeftButton
REACH_PX = 12.0
"""How near to a part the pointer must be, in pixels of the screen."""


class Draggable(pg.GraphicsObject):  # type: ignore[misc]
    """An item with parts that can be moved."""

    _drags = False

    def cursor_at(self, at: QPointF) -> Qt.CursorShape | None:
        """Return the pointer over a part; None where there is none."""
        raise NotImplementedError

    def grab(self, at: QPointF) -> bool:
        """Begin to drag the part at a position. Return whether there is one."""
        raise NotImplementedError

    def drag_to(self, down: QPointF, now: QPointF, *, ended: bool) -> None:
        """Move the part that was grabbed at `down`."""
        raise NotImplementedError

    def hoverEvent(self, event: Any) -> None:  # noqa: D102
        shape = None if event.isExit() else self.cursor_at(event.pos())
        if shape is None:
            self.unsetCursor()
            return
        event.acceptClicks(LEFT)
        event.acceptDrags(LEFT)
        self.setCursor(shape)

    def mouseDragEvent(self, event: Any) -> None:  # noqa: D102
        if event.isStart():
            self._drags = event.button() == LEFT and self.grab(event.buttonDownPos())
        if not self._drags:
            event.ignore()
            return
        event.accept()
        self.drag_to(event.buttonDownPos(), event.pos(), ended=event.isFinish())

    def _reach(self, unknown: float) -> float:
        """Return the reach in units of the view."""
        return REACH_PX * float(self.pixelLength(pg.Point(1.0, 0.0)) or unknown)
