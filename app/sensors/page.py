"""The Sensors page."""

from __future__ import annotations

from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from app.shell.context import AppContext
from app.widgets.naming import named
from gelpolight_core.translation import tr


class SensorsPage(QWidget):
    """Sensors and their calibrations."""

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        self._context = context
        named(self, "sensors", tr("Sensors"))
        QVBoxLayout(self).addWidget(QLabel(tr("No sensors yet."), self))
