"""Handles: what is clicked and dragged in a view with the left button."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt

from gelpolight_core.base.arrays import PointXY

LEFT = Qt.MouseButton.LeftButton
REACH_PX = 12.0
"""How near to a handle the pointer must be, in pixels of the screen."""
LEAST_RADIUS_PX = 1.0
"""A smaller circle could not be distinguished from its centre, or grabbed."""


@dataclass(frozen=True, slots=True)
class Handle:
    """A place that can be dragged.

    Attributes
    ----------
    name : str
        Its name within the view.
    at : (x, y)
        Position, in the units of the view.
    radius : float
        Radius of the circle around it, which is resized where it is grabbed. 0: there is none.
    """

    name: str
    at: PointXY
    radius: float = 0.0

    def moved(self, dx: float, dy: float) -> Handle:
        """Return it at another position."""
        return replace(self, at=(self.at[0] + dx, self.at[1] + dy))

    def resized(self, by: float) -> Handle:
        """Return it with another radius, if it has one."""
        return replace(self, radius=max(self.radius + by, LEAST_RADIUS_PX)) if self.radius else self


class HandleItem(pg.UIGraphicsItem):  # type: ignore[misc]
    """Handles that are hovered, selected and dragged. A subclass, or another item, draws them.

    Attributes
    ----------
    handles : sequence of Handle
        What can be dragged now.
    selected : str
        Name of the handle that the keys move. Empty: none.
    """

    def __init__(self) -> None:
        super().__init__()
        self.handles: Sequence[Handle] = ()
        self.selected = ""
        self._held: tuple[Handle, bool] | None = None

    def on_grab(self, handle: Handle) -> None:
        """Note that a handle was clicked, or begins to be dragged."""

    def on_drag(self, handle: Handle, *, ended: bool) -> None:
        """Use a handle as it was dragged."""

    def select(self, name: str) -> None:
        """Mark the handle that the keys move."""
        self.selected = name
        self.update()

    def select_next(self, step: int) -> None:
        """Select the handle this many positions after the selected one, cyclically."""
        names = [handle.name for handle in self.handles]
        first = -1 if step > 0 else 0
        at = names.index(self.selected) if self.selected in names else first
        self.select(names[(at + step) % len(names)])

    def hoverEvent(self, event: Any) -> None:  # noqa: D102
        shape = None if event.isExit() else self._cursor_at(event.pos())
        if shape is None:
            self.unsetCursor()
            return
        event.acceptClicks(LEFT)
        event.acceptDrags(LEFT)
        self.setCursor(shape)

    def mouseClickEvent(self, event: Any) -> None:  # noqa: D102
        held = None if event.button() != LEFT or event.double() else self._held_at(event.pos())
        if held is None:
            event.ignore()
            return
        event.accept()
        self.on_grab(held[0])

    def mouseDragEvent(self, event: Any) -> None:  # noqa: D102
        down, now = event.buttonDownPos(), event.pos()
        if event.isStart():
            self._held = self._held_at(down) if event.button() == LEFT else None
            if self._held is not None:
                self.on_grab(self._held[0])
        if self._held is None:
            event.ignore()
            return
        event.accept()
        handle, at_rim = self._held
        if at_rim:
            centre = QPointF(*handle.at)
            dragged = handle.resized(_length(now - centre) - _length(down - centre))
        else:
            dragged = handle.moved(now.x() - down.x(), now.y() - down.y())
        if event.isFinish():
            self._held = None
        self.on_drag(dragged, ended=event.isFinish())

    def _cursor_at(self, at: QPointF) -> Qt.CursorShape | None:
        """Return the pointer over a handle, or None."""
        if (held := self._held_at(at)) is None:
            return None
        return Qt.CursorShape.SizeHorCursor if held[1] else Qt.CursorShape.SizeAllCursor

    def _held_at(self, at: QPointF) -> tuple[Handle, bool] | None:
        """Return the nearest handle within reach, True if it is held at its rim.

        None if there is none within reach.
        """
        width, height = self.pixelWidth() or 1.0, self.pixelHeight() or 1.0
        near: list[tuple[float, Handle, bool]] = []
        for handle in self.handles:
            distance_px = math.hypot(
                (at.x() - handle.at[0]) / width, (at.y() - handle.at[1]) / height
            )
            near.append((distance_px, handle, False))
            if handle.radius:
                # The whole circle resizes, so that nobody has to aim at the small square.
                near.append((abs(distance_px - handle.radius / width), handle, True))
        off, nearest, at_rim = min(near, key=lambda item: item[0], default=(math.inf, None, False))
        return None if nearest is None or off > REACH_PX else (nearest, at_rim)


def _length(way: QPointF) -> float:
    return math.hypot(way.x(), way.y())
