"""The start of a calibration: a new sensor, a folder, a recent session; and its one question."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QPushButton, QWidget

from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 460


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
        intro = PlainLabel(
            tr(
                "The program guides you step by step, and checks every image while you can "
                "still repeat it."
            ),
            wrap=True,
        )
        self.new = _choice("start.new", tr("&New calibration"))
        self.open = _choice("start.open", tr("&Open a session folder…"))
        self.demo = _choice("start.demo", tr("&Try the virtual sensor"))
        self.problem = named(PlainLabel(wrap=True), "start.problem", tr("Why it was not opened"))
        show_meaning(self.problem, "fail")
        self.problem.hide()
        self.closed = _choice(
            "start.closed",
            tr("Calibrate it as a &closed sensor"),
            tr("Start a new session with the background and the ball presses of this folder"),
        )
        self.closed.hide()
        self._recent = vbox()
        parts = intro, self.new, self.open, self.demo, self.problem, self.closed
        _column(self, tr("Calibrate a sensor"), *parts, 12, self._recent)

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
            button = _choice(f"start.recent.{number}", text, str(folder), height=0)
            button.setAccessibleName(tr("Continue {s}").format(s=text))
            button.setFlat(True)
            button.setFixedWidth(WIDTH)
            button.setStyleSheet("text-align: left;")
            button.clicked.connect(lambda _=False, f=folder: self.recent_wanted.emit(str(f)))
            self._recent.addWidget(button)


class QuestionView(QWidget):
    """Asks which route the calibration takes.

    Signals
    -------
    answered(bool)
        Whether the sensor can be opened.
    """

    answered = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        named(self, "question", tr("Can the sensor be opened?"))
        self.can = _choice("question.open", tr("&Yes, the membrane can be taken off"))
        self.can.clicked.connect(lambda: self.answered.emit(True))
        opened = PlainLabel(
            tr(
                "Lens, top surface, lights and membrane are measured one by one, in nine "
                "steps. This gives the most exact depth. You need two checkerboards, a "
                "mirror, a white board and balls."
            ),
            wrap=True,
        )
        cannot = _choice("question.closed", tr("&No, the membrane is bonded"))
        cannot.clicked.connect(lambda: self.answered.emit(False))
        bonded = PlainLabel(
            tr(
                "For GelSight Mini, DIGIT, 9DTact and most home-made sensors. A few steps: one "
                "image of the untouched membrane and some presses of a ball of known diameter."
            ),
            wrap=True,
        )
        self.back = _choice("question.back", tr("&Back"))
        self.back.setFlat(True)
        parts = self.can, opened, 10, cannot, bonded, 10, self.back
        _column(self, tr("Can the sensor be opened?"), *parts)


def _choice(name: str, text: str, tip: str = "", *, height: int = 40) -> QPushButton:
    """Return a wide button."""
    button = named(QPushButton(text), name, text.replace("&", ""), tip)
    button.setMinimumHeight(height)
    return button


def _column(view: QWidget, title: str, *parts: object) -> None:
    """Fill a view with a title and parts of one width in its middle."""
    heading = PlainLabel(title)
    make_bold(heading, size=1.6)
    for part in parts:
        if isinstance(part, QWidget):
            part.setFixedWidth(WIDTH)
    vbox(heading, *parts, of=view, spacing=10).setAlignment(Qt.AlignmentFlag.AlignCenter)
