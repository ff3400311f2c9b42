"""Messages that appear, can be read and disappear without blocking the user."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from app.widgets import theme
from app.widgets.actions import push_button
from app.widgets.icons import icon
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.native_windows import give_own_window, native_windows
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding, Verdict

log = logging.getLogger(__name__)

ReadT = TypeVar("ReadT")

MOST = 4
MARGIN = 12
# Allows half the speed of a slow reader (180 words a minute), and a minimum time.
LEAST_MS = 5000
MS_A_WORD = 650
KINDS = {
    Verdict.PASS: (logging.INFO, "Note", "info", "accent"),
    Verdict.WARN: (logging.WARNING, "Warning", "warn", "warn"),
    Verdict.FAIL: (logging.ERROR, "Error", "fail", "fail"),
}
"""Level in the log, word, icon and colour of a message."""


class Toast(QWidget):
    """One message with its buttons."""

    gone = Signal()

    def __init__(
        self,
        parent: QWidget,
        finding: Finding,
        actions: tuple[tuple[str, Callable[[], object]], ...],
    ) -> None:
        super().__init__(parent)
        self.finding, self.text = finding, finding.text
        self.times = 1
        _, word, sign_name, self._colour = KINDS[finding.verdict]
        set_names(self, "toast", f"{word}: {self.text}")
        give_own_window(self)  # over the 3D view, which has a native window
        self._label = PlainLabel(self.text, self, wrap=True)
        self._label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        sign = PlainLabel(parent=self)
        self._label.setAlignment(Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft)
        sign.setPixmap(icon(sign_name, self._colour).pixmap(22, 22))
        sign.setAlignment(Qt.AlignmentFlag.AlignTop)
        close = set_names(QToolButton(self), "toast.close", "Close this message", "Close")
        close.setIcon(icon("close"))
        close.setAutoRaise(True)
        close.clicked.connect(self.dismiss)
        top = hbox(sign, (self._label, 1), (close, 0, Qt.AlignmentFlag.AlignTop))
        self._column = vbox(top, of=self, margins=(12, 10, 8, 10))
        if actions:
            row = hbox(None)
            for i, (label, act) in enumerate(actions):
                button = push_button(f"toast.action{i}", label, act)
                button.clicked.connect(self.dismiss)
                row.addWidget(button)
            self._column.addLayout(row)
        self._timer = timer(self, 0, self.dismiss, once=True)
        self._restart()

    def height_for(self, width: int) -> int:
        """Return the height that the message needs at a given width."""
        self._column.activate()
        if self._column.hasHeightForWidth():
            return self._column.totalHeightForWidth(width)
        return self._column.totalSizeHint().height()

    def again(self) -> None:
        """Count a repeated message instead of showing it twice."""
        self.times += 1
        self._label.setText(f"{self.text}  ({self.times}x)")
        self._restart()

    def _restart(self) -> None:
        # An error stays until it is closed: the user may be at the sensor, not at the screen.
        if self.finding.verdict is not Verdict.FAIL:
            self._timer.start(max(LEAST_MS, MS_A_WORD * len(self.text.split())))

    def dismiss(self) -> None:
        """Close and disappear."""
        self._timer.stop()
        self.gone.emit()
        self.hide()
        self.deleteLater()

    def enterEvent(self, event: QEvent) -> None:
        """Stay while the user reads it."""
        self._timer.stop()

    def leaveEvent(self, event: QEvent) -> None:
        """Restart the countdown."""
        self._restart()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw a rectangle with an edge in the colour of the message kind."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.colour("line")), 1))
        painter.setBrush(theme.colour("base"))
        painter.drawRoundedRect(self.rect().adjusted(0, 0, -1, -1), 6, 6)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(theme.colour(self._colour))
        painter.drawRect(0, 6, 4, self.height() - 12)


class Toasts(QObject):
    """The messages in the lower left corner, where no page has a main button."""

    def __init__(self) -> None:
        super().__init__()
        self._host: QWidget | None = None
        self._over: QWidget | None = None
        self._shown: list[Toast] = []
        self._open_log_folder: Callable[[], None] | None = None
        # A native window that appears later would cover the messages.
        native_windows.appeared.connect(self._raise_all)

    def attach(
        self, host: QWidget, open_log_folder: Callable[[], None], *, over: QWidget | None = None
    ) -> None:
        """Show the messages as children of a window.

        Parameters
        ----------
        host : QWidget
            The window. Whatever changes inside its other children stays below the messages.
        open_log_folder : callable
            Shows the log files.
        over : QWidget, optional
            The part of the window whose corner they use. Default: all of it.
        """
        self._host, self._over = host, over or host
        self._open_log_folder = open_log_folder
        self._over.installEventFilter(self)
        host.destroyed.connect(self._detach)

    def show(
        self,
        text: str,
        verdict: str = Verdict.PASS,
        *,
        actions: tuple[tuple[str, Callable[[], object]], ...] = (),
        with_log: bool = False,
    ) -> None:
        """Show a message, and write it to the log.

        Parameters
        ----------
        text : str
            One or two sentences.
        verdict : str
            ``pass``, ``warn`` or ``fail``. The last one stays until it is closed.
        actions : tuple of (label, callable)
            Buttons, such as "Undo".
        with_log : bool
            Whether a button opens the folder of the log.
        """
        finding = Finding("message", text, verdict=Verdict(verdict))
        log.log(KINDS[finding.verdict][0], "%s", text)
        if self._host is None:
            return
        for toast in self.shown():
            if toast.finding == finding and not actions:
                toast.again()
                self._arrange()
                return
        if with_log and self._open_log_folder is not None:
            actions = (*actions, ("Open the log folder", self._open_log_folder))
        toast = Toast(self._host, finding, actions)
        toast.gone.connect(lambda: self._forget(toast))
        self._shown.append(toast)
        for oldest in self._shown[:-MOST]:
            oldest.dismiss()
        toast.show()
        self._arrange()

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Show an error that the user can correct, and go on after the block."""
        try:
            yield
        except InputError as error:
            self.show(str(error), "fail")

    def read_list(self, read: Callable[[], tuple[ReadT, ...]]) -> tuple[ReadT, ...]:
        """Return what a function lists. If it refuses, show why, and return nothing."""
        with self.errors():
            return read()
        return ()

    def shown(self) -> list[Toast]:
        """Return the visible messages, oldest first."""
        return list(self._shown)

    def _detach(self) -> None:
        self._host = self._over = None
        self._shown.clear()

    def _forget(self, toast: Toast) -> None:
        if toast in self._shown:
            self._shown.remove(toast)
            self._arrange()

    def clear(self) -> None:
        """Close all messages. They stay in the log."""
        for toast in self.shown():
            toast.dismiss()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Follow the size and position of the part of the window that is used."""
        if event.type() in (QEvent.Type.Resize, QEvent.Type.Move):
            self._arrange()
        return False

    def _arrange(self) -> None:
        if self._host is None or self._over is None:
            return
        corner = self._over.mapTo(self._host, QPoint())
        area = QRect(corner, self._over.size()).adjusted(MARGIN, MARGIN, -MARGIN, -MARGIN)
        width = min(420, area.width())
        bottom = area.bottom() + 1
        for toast in reversed(self.shown()):
            height = toast.height_for(width)
            bottom -= height
            toast.setGeometry(area.left(), bottom, width, height)
            bottom -= 8
        self._raise_all()

    def _raise_all(self) -> None:
        for toast in self._shown:
            toast.raise_()
            # Qt does nothing if the widget is already the last child; the window system's order of
            # native windows is another one.
            if toast.windowHandle() is not None:
                toast.windowHandle().raise_()
