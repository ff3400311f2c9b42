"""The first question about a new sensor: whether it can be opened."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QPushButton, QWidget

from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.meaning import make_bold
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 460


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
        title = PlainLabel(tr("Can the sensor be opened?"))
        make_bold(title, size=1.6)
        self.can = self._answer("open", tr("&Yes, the membrane can be taken off"))
        self.can.clicked.connect(lambda: self.answered.emit(True))
        opened = PlainLabel(
            tr(
                "Lens, top surface, lights and membrane are measured one by one, in nine "
                "steps. This gives the most exact depth. You need two checkerboards, a "
                "mirror, a white board and balls."
            ),
            wrap=True,
        )
        cannot = self._answer("closed", tr("&No, the membrane is bonded"))
        cannot.clicked.connect(lambda: self.answered.emit(False))
        bonded = PlainLabel(
            tr(
                "For GelSight Mini, DIGIT, 9DTact and most home-made sensors. A few steps: one "
                "image of the untouched membrane and some presses of a ball of known diameter."
            ),
            wrap=True,
        )
        self.back = self._answer("back", tr("&Back"))
        self.back.setFlat(True)
        for label in (opened, bonded):
            label.setFixedWidth(WIDTH)
        parts = title, self.can, opened, 10, cannot, bonded, 10, self.back
        vbox(*parts, of=self, spacing=10).setAlignment(Qt.AlignmentFlag.AlignCenter)

    def _answer(self, name: str, text: str) -> QPushButton:
        button = named(QPushButton(text), f"question.{name}", text.replace("&", ""))
        button.setMinimumHeight(40)
        button.setFixedWidth(WIDTH)
        return button
