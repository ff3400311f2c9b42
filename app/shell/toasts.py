"""Messages that come, are read and go, without stopping anybody's work."""

from __future__ import annotations

import logging
from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import (
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.shell import theme
from app.shell.icons import icon
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr

log = logging.getLogger(__name__)

MOST = 4
MARGIN = 12
WIDTH = 420
# Twice a slow reader's 180 words a minute, and never so short that it is missed.
LEAST_MS = 5000
MS_A_WORD = 650
ICONS = {"info": ("info", "accent"), "pass": ("pass", "pass"), "warn": ("warn", "warn")}
ICONS["fail"] = ("fail", "fail")
LEVELS = {"info": logging.INFO, "pass": logging.INFO, "warn": logging.WARNING}
WORDS = {"info": tr("Note"), "pass": tr("Done"), "warn": tr("Attention"), "fail": tr("Problem")}


class Toast(QWidget):
    """One message with its buttons."""

    gone = Signal()

    def __init__(
        self, parent: QWidget, text: str, kind: str, actions: tuple[tuple[str, Callable], ...]
    ) -> None:
        super().__init__(parent)
        self.text = text
        self.kind = kind
        self.times = 1
        named(self, "toast", f"{WORDS[kind]}: {text}")
        self._label = PlainLabel(text, self)
        self._label.setWordWrap(True)
        self._label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        sign = PlainLabel(parent=self)
        self._label.setAlignment(Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft)
        sign.setPixmap(icon(*ICONS[kind]).pixmap(22, 22))
        sign.setAlignment(Qt.AlignmentFlag.AlignTop)
        close = named(QToolButton(self), "toast.close", tr("Close the message"), tr("Close"))
        close.setIcon(icon("close"))
        close.setAutoRaise(True)
        close.clicked.connect(self.dismiss)
        top = QHBoxLayout()
        top.addWidget(sign)
        top.addWidget(self._label, 1)
        top.addWidget(close, 0, Qt.AlignmentFlag.AlignTop)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(12, 10, 8, 10)
        layout.addLayout(top)
        if actions:
            row = QHBoxLayout()
            row.addStretch(1)
            for i, (label, act) in enumerate(actions):
                button = named(QPushButton(label, self), f"toast.action{i}", label)
                button.clicked.connect(act)
                button.clicked.connect(self.dismiss)
                row.addWidget(button)
            layout.addLayout(row)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.dismiss)
        self._restart()

    def height_for(self, width: int) -> int:
        """Return the height that the message needs at a width."""
        layout = self.layout()
        layout.activate()
        return (
            layout.totalHeightForWidth(width)
            if layout.hasHeightForWidth()
            else (layout.totalSizeHint().height())
        )

    def again(self) -> None:
        """Count the same message instead of showing it twice."""
        self.times += 1
        self._label.setText(f"{self.text}  ({self.times}x)")
        self._restart()

    def _restart(self) -> None:
        # A problem stays until it is closed: the person may be at the sensor, not at the screen.
        if self.kind != "fail":
            self._timer.start(max(LEAST_MS, MS_A_WORD * len(self.text.split())))

    def dismiss(self) -> None:
        """Go away."""
        self._timer.stop()
        self.gone.emit()
        self.hide()
        self.deleteLater()

    def enterEvent(self, event: QEvent) -> None:
        """Stay while somebody reads."""
        self._timer.stop()

    def leaveEvent(self, event: QEvent) -> None:
        """Count down anew."""
        self._restart()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw a plate with an edge in the colour of the kind."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.colour("line")), 1))
        painter.setBrush(theme.colour("base"))
        painter.drawRoundedRect(self.rect().adjusted(0, 0, -1, -1), 6, 6)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(theme.colour(ICONS[self.kind][1]))
        painter.drawRect(0, 6, 4, self.height() - 12)


class Toasts(QObject):
    """The stack of messages in the lower right corner of a window."""

    def __init__(self) -> None:
        super().__init__()
        self._host: QWidget | None = None
        self._shown: list[Toast] = []
        self._show_log: Callable[[], None] | None = None

    def attach(self, host: QWidget, show_log: Callable[[], None]) -> None:
        """Show the messages over `host`."""
        self._host = host
        self._show_log = show_log
        host.installEventFilter(self)
        host.destroyed.connect(self._detach)

    def show(
        self,
        text: str,
        kind: str = "info",
        *,
        actions: tuple[tuple[str, Callable[[], object]], ...] = (),
        with_log: bool = False,
    ) -> None:
        """Show a message and put it into the log.

        Parameters
        ----------
        text : str
            One or two sentences.
        kind : str
            ``info``, ``pass``, ``warn`` or ``fail``; the last stays until it is closed.
        actions : tuple of (label, callable)
            Buttons, such as "Undo".
        with_log : bool
            Whether a button opens the log.
        """
        log.log(LEVELS.get(kind, logging.ERROR), "%s", text)
        if self._host is None:
            return
        for toast in self.shown():
            if (toast.text, toast.kind) == (text, kind) and not actions:
                toast.again()
                self._place()
                return
        if with_log and self._show_log is not None:
            actions = (*actions, (tr("Show log"), self._show_log))
        toast = Toast(self._host, text, kind, actions)
        toast.gone.connect(lambda: self._forget(toast))
        self._shown.append(toast)
        for old in self._shown[:-MOST]:
            old.dismiss()
        toast.show()
        self._place()

    def shown(self) -> list[Toast]:
        """Return the messages that are shown, oldest first."""
        return list(self._shown)

    def _detach(self) -> None:
        self._host = None
        self._shown.clear()

    def _forget(self, toast: Toast) -> None:
        if toast in self._shown:
            self._shown.remove(toast)
            self._place()

    def clear(self) -> None:
        """Close all messages."""
        for toast in self.shown():
            toast.dismiss()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Follow the window's size."""
        if event.type() == QEvent.Type.Resize:
            self._place()
        return False

    def _place(self) -> None:
        if self._host is None:
            return
        width = min(WIDTH, self._host.width() - 2 * MARGIN)
        bottom = self._host.height() - MARGIN
        for toast in reversed(self.shown()):
            height = toast.height_for(width)
            bottom -= height
            toast.setGeometry(self._host.width() - width - MARGIN, bottom, width, height)
            toast.raise_()
            bottom -= 8
