"""The help of a step: how the sensor is assembled, and what the guide says about it."""

from __future__ import annotations

from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QFrame, QPushButton, QToolButton

from app.calibrate.assembly import AssemblyDrawing
from app.calibrate.step_data import Step
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 320


class StepHelp(QToolButton):
    """A button that shows the drawing of the set-up, with a button to the guide."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.help", tr("Help on this step"), tr("How to set it up"))
        self.setText("?")
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._sheet = named(
            QFrame(self, Qt.WindowType.Popup), "calibrate.help.sheet", tr("Help on this step")
        )
        self._sheet.setFixedWidth(WIDTH)
        self._drawing = AssemblyDrawing()
        self._words = PlainLabel(wrap=True)
        self.guide = named(
            QPushButton(tr("Read the &guide")), "calibrate.help.guide", tr("Read about this step")
        )
        vbox(self._drawing, self._words, self.guide, of=self._sheet, margins=16)
        self.guide.clicked.connect(self._sheet.close)
        self.clicked.connect(self._open)

    def show_step(self, step: Step) -> None:
        """Show the set-up of another step."""
        self._drawing.show_assembly(step.assembly)
        self._words.setText(step.advice)
        self._words.setVisible(bool(step.advice))

    def _open(self) -> None:
        corner = self.mapToGlobal(self.rect().bottomRight())
        self._sheet.adjustSize()
        self._sheet.move(corner - QPoint(WIDTH, -4))
        self._sheet.show()
