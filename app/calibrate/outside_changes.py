"""Warns that another program changed the files of the open session, and offers what to do."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.calibrate.model import WizardModel
from app.widgets.buttons import push_button
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError


class OutsideBar(QWidget):
    """A bar with two buttons, visible only if files were changed.

    Parameters
    ----------
    model : WizardModel
        Model of the wizard.
    """

    def __init__(self, model: WizardModel) -> None:
        super().__init__()
        named(self, "calibrate.outside", "Changed by another program")
        self._model = model
        self._refusal = ""
        self.sentence = PlainLabel(wrap=True)
        named(self.sentence, "calibrate.outside.sentence", "What was changed")
        show_meaning(self.sentence, "warn")
        make_bold(self.sentence)
        self.sentence.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        self.reload = push_button(
            "calibrate.outside.reload",
            "Re&load",
            partial(self._act, model.reload),
            tip="Read the changed files; this clears the history of corrections",
        )
        self.overwrite = push_button(
            "calibrate.outside.overwrite",
            "&Keep mine",
            partial(self._act, model.project.overwrite),
            tip="Overwrite the changed files with the state of this page",
        )
        hbox((self.sentence, 1), self.reload, self.overwrite, of=self, margins=(8, 4, 8, 4))
        self._timer = QTimer(self, interval=1000)
        self._timer.timeout.connect(self.check)
        self.hide()

    def watch(self, on: bool) -> None:
        """Check regularly while the page is shown."""
        self._timer.stop()
        if on:
            self._timer.start()
            self.check()

    def check(self) -> None:
        """Check whether files were changed, and say so."""
        changed = self._model.project.changed_outside()
        if not changed:
            self._refusal = ""
        text = "Another program changed {names} while this session is open.".format(
            names=" and ".join(path.name for path in changed)
        )
        self.sentence.setText(self._refusal or text)
        self.setVisible(bool(changed))

    def _act(self, act: Callable[[], None]) -> None:
        try:
            act()
        except InputError as error:
            self._refusal = str(error)
        self.check()
