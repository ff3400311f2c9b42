"""A mouse whose events reach a widget at once; the moves of QTest go through the window system."""

import itertools

from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

LEFT, NONE = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
MOVE_MS = 12
"""The scene processes at most a hundred moves per second."""
STEPS = 4


def send(widget: QWidget, kind: QEvent.Type, at: QPointF, held: Qt.MouseButton = NONE) -> None:
    """Send an event of the left button, or a move with a button held."""
    button = NONE if kind == QEvent.Type.MouseMove else LEFT
    place, keys = QPointF(widget.mapToGlobal(at)), Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(widget, QMouseEvent(kind, at, place, button, held, keys))


def drag(widget: QWidget, *points: QPointF, drop: bool = True) -> None:
    """Drag with the left button along points of a widget."""
    send(widget, QEvent.Type.MouseMove, points[0])
    send(widget, QEvent.Type.MouseButtonPress, points[0], LEFT)
    for a, b in itertools.pairwise(points):
        for step in range(1, STEPS + 1):
            QTest.qWait(MOVE_MS)
            send(widget, QEvent.Type.MouseMove, a + step / STEPS * (b - a), LEFT)
    if drop:
        QTest.qWait(MOVE_MS)
        send(widget, QEvent.Type.MouseButtonRelease, points[-1])
