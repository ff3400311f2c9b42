"""The gel of a calibration: its name and its presses."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLineEdit, QWidget

from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr


class GelCarePanel(QWidget):
    """Shows the presses on the gel since a calibration, with the name of the elastomer to edit.

    Signals
    -------
    renamed(str)
        The user has entered another name.
    """

    renamed = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        named(self, "sensors.gel", tr("Gel care"))
        self._name = ""
        self.elastomer = named(
            QLineEdit(), "sensors.gel.elastomer", tr("Name or serial number of the elastomer"),
            tr("Name or serial number of the elastomer. It is kept in the calibration file"),
        )  # fmt: skip
        self.elastomer.setPlaceholderText(tr("not stated"))
        self.elastomer.editingFinished.connect(self._on_edited)
        label = PlainLabel(tr("&Elastomer"))
        label.setBuddy(self.elastomer)
        self._care = named(PlainLabel(wrap=True), "sensors.gel.care", tr("Use of the gel"))
        vbox(hbox(label, (self.elastomer, 1)), self._care, of=self, margins=0)

    def show_gel(self, elastomer: str, presses: str) -> None:
        """Show the name of the elastomer, and its presses or why they are not known."""
        if elastomer != self._name or not self.elastomer.hasFocus():
            self._name = elastomer
            self.elastomer.setText(elastomer)
        self._care.setText(presses)

    def _on_edited(self) -> None:
        name = self.elastomer.text().strip()
        if name != self._name:
            self._name = name
            self.renamed.emit(name)
