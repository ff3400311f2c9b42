"""A window to read and copy the log."""

from __future__ import annotations

import logging

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices, QFontDatabase, QGuiApplication, QHideEvent, QShowEvent
from PySide6.QtWidgets import QPlainTextEdit, QWidget

from app.services.log import KEPT, Log
from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.naming import named
from app.widgets.timers import timer


class LogWindow(Dialog):
    """Shows the records of this run, newest last."""

    def __init__(self, log: Log, parent: QWidget | None = None) -> None:
        super().__init__(parent, "log", "Log")
        self._log = log
        self._seen = 0
        self.resize(900, 480)
        self._levels = named(ComboBox(self), "log.level", "Minimum level")
        for label, level in (
            ("All", logging.DEBUG),
            ("Information and above", logging.INFO),
            ("Warnings and errors", logging.WARNING),
            ("Errors only", logging.ERROR),
        ):
            self._levels.addItem(label, level)
        self._levels.setCurrentIndex(1)
        self._levels.currentIndexChanged.connect(self._show_all)
        self._text = named(QPlainTextEdit(self), "log.text", "Log records")
        self._text.setReadOnly(True)
        self._text.setMaximumBlockCount(KEPT)
        self._text.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self._text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        copy = push_button(
            "log.copy", "Copy", self.copy, icon_name="copy", accessible="Copy the log"
        )
        folder = push_button(
            "log.folder",
            "Open folder",
            lambda: QDesktopServices.openUrl(QUrl.fromLocalFile(str(log.folder))),
            icon_name="folder",
            accessible="Open the folder of the log files",
            tip=str(log.folder),
        )
        self.fill(hbox(PlainLabel("Show"), self._levels, None, copy, folder), (self._text, 1))
        self._timer = timer(self, 250, self._show_new)

    def copy(self) -> None:
        """Copy the shown records to the clipboard."""
        QGuiApplication.clipboard().setText(self._text.toPlainText())

    def showEvent(self, event: QShowEvent) -> None:
        """Start following the log."""
        self._show_new()
        self._timer.start()
        super().showEvent(event)

    def hideEvent(self, event: QHideEvent) -> None:
        """Stop following the log."""
        self._timer.stop()
        super().hideEvent(event)

    def _show_all(self) -> None:
        self._seen = 0
        self._text.clear()
        self._show_new()

    def _show_new(self) -> None:
        records = self._log.recent.since(self._seen)
        if not records:
            return
        self._seen = records[-1].number
        lines = [r.text for r in records if r.level >= self._levels.currentData()]
        if lines:
            self._text.appendPlainText("\n".join(lines))
