"""The messages of this run: a button in the state bar that counts the new ones, and their list."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPoint, QSize, Qt
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import QFrame, QListWidget, QListWidgetItem, QToolButton, QWidget

from app.services.toasts import ICONS, WORDS, Toasts
from app.theme.icons import icon
from app.widgets.buttons import push_button
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.finding import Finding, worst_of


class NotificationsButton(QToolButton):
    """Shows how many messages are new, with the sign of the most important one.

    Parameters
    ----------
    toasts : Toasts
        The messages.
    show_log : callable
        Opens the log.
    """

    def __init__(
        self, toasts: Toasts, show_log: Callable[[], None], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        named(self, "main.notifications", "Notifications", "Messages of this run")
        self.setAutoRaise(True)
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.setIconSize(QSize(18, 18))
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._toasts, self._show_log = toasts, show_log
        self._new: list[Finding] = []
        toasts.history_changed.connect(self._on_message)
        self.clicked.connect(self.show_list)
        self._show()

    def show_list(self) -> NotificationList:
        """Show the list of messages below the button. All of them count as read."""
        self._new.clear()
        self._show()
        panel = NotificationList(self._toasts, self._show_log, self)
        panel.resize(QSize(480, 360).boundedTo(self.window().size()))
        corner = self.mapToGlobal(QPoint(self.width(), self.height() + 4))
        panel.move(corner - QPoint(panel.width(), 0))
        panel.show()
        panel.list.setFocus()
        return panel

    def _on_message(self) -> None:
        self._new.append(self._toasts.history[-1].finding)
        self._show()

    def _show(self) -> None:
        worst = worst_of(self._new)
        self.setIcon(icon("info") if worst is None else icon(*ICONS[worst.verdict]))
        self.setText(str(len(self._new)) if self._new else "")
        text = f"Notifications: {len(self._new)} new"
        self.setAccessibleName(text if self._new else "Notifications")


class NotificationList(QFrame):
    """A list of messages, newest first, that closes when something else is clicked."""

    def __init__(self, toasts: Toasts, show_log: Callable[[], None], parent: QWidget) -> None:
        super().__init__(parent, Qt.WindowType.Popup)
        named(self, "notifications", "Notifications")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self.list = named(QListWidget(self), "notifications.list", "Messages, newest first")
        self.list.setWordWrap(True)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setSelectionMode(QListWidget.SelectionMode.NoSelection)
        for message in reversed(toasts.history):
            times = f"  ({message.times}x)" if message.times > 1 else ""
            text, verdict = message.finding.text, message.finding.verdict
            item = QListWidgetItem(icon(*ICONS[verdict]), f"{message.when:%H:%M:%S}  {text}{times}")
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{WORDS[verdict]}: {text}")
            self.list.addItem(item)
        empty = PlainLabel("No messages in this run", self)
        empty.setVisible(not toasts.history)
        self.list.setVisible(bool(toasts.history))
        close = push_button("notifications.clear", "Close visible messages", toasts.clear)
        close.setEnabled(bool(toasts.shown()))
        log = push_button(
            "notifications.log", "Show log", show_log, icon_name="log", accessible="Log"
        )
        for button in (close, log):
            button.clicked.connect(self.close)
        centre = Qt.AlignmentFlag.AlignCenter
        vbox((empty, 1, centre), (self.list, 1), hbox(None, close, log), of=self)

    def hideEvent(self, event: QHideEvent) -> None:
        """Go away for good: it is made again when it is asked for."""
        super().hideEvent(event)
        self.deleteLater()
