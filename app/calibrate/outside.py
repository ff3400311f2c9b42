"""Says that something else has changed the files of the open session, and what can be done."""

from __future__ import annotations

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSizePolicy, QWidget

from app.calibrate.controller import CalibrationController
from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

LOOK_MS = 1000


class OutsideBar(QWidget):
    """A line with two buttons, seen only where there is something to decide.

    Parameters
    ----------
    controller : CalibrationController
        Of the session.
    """

    def __init__(self, controller: CalibrationController) -> None:
        super().__init__()
        named(self, "calibrate.outside", tr("Changed by something else"))
        self._controller = controller
        self._refusal = ""
        self.sentence = named(PlainLabel(), "calibrate.outside.sentence", tr("What was changed"))
        self.sentence.setWordWrap(True)
        show_meaning(self.sentence, "warn")
        make_bold(self.sentence)
        self.sentence.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        self.reload = named(
            QPushButton(tr("Re&load")),
            "calibrate.outside.reload",
            tr("Reload"),
            tr("Read the files as they are now; the history of corrections begins anew"),
        )
        self.overwrite = named(
            QPushButton(tr("&Keep mine")),
            "calibrate.outside.overwrite",
            tr("Keep mine"),
            tr("Write what this page shows over what was changed"),
        )
        self.reload.clicked.connect(self._reload)
        self.overwrite.clicked.connect(self._overwrite)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 4, 8, 4)
        row.addWidget(self.sentence, 1)
        row.addWidget(self.reload)
        row.addWidget(self.overwrite)
        self._timer = QTimer(self)
        self._timer.setInterval(LOOK_MS)
        self._timer.timeout.connect(self.look)
        self.hide()

    def watch(self, on: bool) -> None:
        """Look from time to time, while the page is shown."""
        if on:
            self._timer.start()
            self.look()
        else:
            self._timer.stop()

    def look(self) -> None:
        """Look whether anything was changed, and say so."""
        changed = self._controller.project.changed_outside()
        if not changed:
            self._refusal = ""
        said = tr("{names} was changed by something else while this session is open.").format(
            names=tr(" and ").join(path.name for path in changed)
        )
        self.sentence.setText(self._refusal or said)
        self.setVisible(bool(changed))

    def _reload(self) -> None:
        try:
            self._controller.reload()
        except InputError as error:
            self._refusal = str(error)
        self.look()

    def _overwrite(self) -> None:
        try:
            self._controller.project.overwrite()
        except InputError as error:
            self._refusal = str(error)
        self.look()
