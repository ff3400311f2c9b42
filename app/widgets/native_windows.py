"""Widgets with a native window of their own inside the main window."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QPaintEvent, QWindow
from PySide6.QtWidgets import QWidget


class NativeWindowWatcher(QObject):
    """Reports native windows that appear, and repaints what is uncovered around them.

    The newest native window covers the others. Qt would leave out what a closed menu or a hidden
    view uncovers in a window that has an OpenGL widget in a native window of its own, and in that
    one: without a compositor the image of the menu or view stayed.

    Signals
    -------
    appeared()
        A widget with a native window of its own was shown.
    """

    appeared = Signal()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Report a widget that is shown, and repaint what is uncovered."""
        if isinstance(watched, QWindow) and isinstance(event, QPaintEvent):
            widget = QWidget.find(watched.winId())
            if widget is not None:
                widget.update(event.region())
        elif event.type() == QEvent.Type.Show and isinstance(watched, QWidget):
            for widget in (watched, watched.window()):
                widget.windowHandle().installEventFilter(self)
            self.appeared.emit()
        return False


native_windows = NativeWindowWatcher()


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
