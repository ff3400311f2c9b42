"""Widgets with a native window of their own inside the main window."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtWidgets import QWidget


class NativeWindows(QObject):
    """Reports native windows that appear. The newest one covers the others.

    Signals
    -------
    appeared()
        A widget with a native window of its own was shown.
    """

    appeared = Signal()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Report a widget that is shown."""
        if event.type() == QEvent.Type.Show:
            self.appeared.emit()
        return False


native_windows = NativeWindows()


def give_own_window(widget: QWidget) -> None:
    """Give a widget a native window. The widgets around it are not changed.

    An OpenGL widget in such a window is composed by itself. Otherwise Qt composes the whole window
    with OpenGL at every change of any widget, which is too slow with a software renderer, and
    closes and reopens the window when its first OpenGL widget appears. A widget that overlaps such
    a widget needs a native window, too.
    """
    widget.setAttribute(Qt.WidgetAttribute.WA_DontCreateNativeAncestors)
    widget.setAttribute(Qt.WidgetAttribute.WA_NativeWindow)
    widget.installEventFilter(native_windows)
