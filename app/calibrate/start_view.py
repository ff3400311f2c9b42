"""The start of a calibration: a new sensor, a session folder, or a recent session."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QPushButton, QWidget

from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr


class StartView(QWidget):
    """Offers the buttons to start or continue a calibration.

    Signals
    -------
    recent_wanted(str)
        Folder of a recent session.
    """

    recent_wanted = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        named(self, "start", tr("Start a calibration"))
        title = PlainLabel(tr("Calibrate a sensor"))
        make_bold(title, size=1.6)
        intro = PlainLabel(
            tr(
                "The program guides you step by step, and checks every image while you can "
                "still repeat it."
            )
        )
        intro.setWordWrap(True)
        self.new, self.open, self.demo = (
            named(QPushButton(text), f"start.{name}", text.replace("&", ""))
            for name, text in (
                ("new", tr("&New calibration")),
                ("open", tr("&Open a session folder…")),
                ("demo", tr("&Try the virtual sensor")),
            )
        )
        for button in (self.new, self.open, self.demo):
            button.setMinimumHeight(40)
        self.problem = named(PlainLabel(wrap=True), "start.problem", tr("Why it was not opened"))
        show_meaning(self.problem, "fail")
        self.problem.hide()
        text = tr("Calibrate it as a &closed sensor")
        self.closed = named(
            QPushButton(text),
            "start.closed",
            text.replace("&", ""),
            tr("Start a new session with the background and the ball presses of this folder"),
        )
        self.closed.hide()
        self._recent = vbox()
        parts = intro, self.new, self.open, self.demo, self.problem, self.closed
        for part in parts:
            part.setFixedWidth(460)
        column = vbox(title, *parts, 12, self._recent, of=self, spacing=10)
        column.setAlignment(Qt.AlignmentFlag.AlignCenter)

    def show_problem(self, sentence: str, *, closed: bool = False) -> None:
        """Show why a session was not opened; hide the message if the text is empty.

        With `closed`, offer to use the folder for a closed sensor.
        """
        self.closed.setVisible(closed)
        if closed:
            sentence += " " + tr(
                "If the sensor cannot be opened, calibrate it from its background and ball "
                "presses alone."
            )
        self.problem.setText(sentence)
        self.problem.setVisible(bool(sentence))

    def show_recent(self, folders: Sequence[Path]) -> None:
        """Show buttons for these sessions."""
        while self._recent.count():
            item = self._recent.takeAt(0)
            if item is not None and (old := item.widget()) is not None:
                old.deleteLater()
        if folders:
            self._recent.addWidget(PlainLabel(tr("Continue a recent session")))
        for number, folder in enumerate(folders[:6]):
            text = f"{folder.parent.parent.name} / {folder.name}"
            button = named(
                QPushButton(text), f"start.recent.{number}", tr("Continue {s}").format(s=text)
            )
            button.setToolTip(plain_tip(str(folder)))
            button.setFlat(True)
            button.setFixedWidth(460)
            button.setStyleSheet("text-align: left;")
            button.clicked.connect(lambda _=False, f=folder: self.recent_wanted.emit(str(f)))
            self._recent.addWidget(button)
