"""Dialog to edit the list of known objects."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QListWidget, QWidget

from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.reference import Truth, check_named

NEW = Truth("cylinder", 5.0, name="New cylinder")


class IndentersDialog(Dialog):
    """Edits the list. Errors are shown below it, and an invalid list is not accepted.

    Attributes
    ----------
    indenters : tuple of Truth
        The accepted list.
    """

    def __init__(self, indenters: tuple[Truth, ...], parent: QWidget | None = None) -> None:
        kinds = Kinds.Save | Kinds.Cancel
        super().__init__(parent, "measure.indenters", "Known objects", kinds, once=True)
        self.resize(560, 360)
        self.indenters = indenters
        self._typed = list(indenters)
        self.names = named(QListWidget(), "measure.indenters.names", "Known objects")
        self.form = Form(NEW, "measure.indenters")
        self.problem = named(
            PlainLabel(wrap=True), "measure.indenters.problem", "Errors in the list"
        )
        show_meaning(self.problem, "fail")
        add = push_button("measure.indenters.add", "&Add", self.add, icon_name="add")
        remove = push_button("measure.indenters.remove", "&Remove", self.remove, icon_name="remove")
        for button in (add, remove):
            button.setAutoDefault(False)
        left = vbox((self.names, 1), hbox(add, remove))
        self.fill(hbox((left, 1), (vbox(self.form, None), 1), spacing=16), self.problem)
        self.names.addItems([typed.name for typed in self._typed])
        self.names.currentRowChanged.connect(self._show)
        self.form.changed.connect(lambda _name, _value: self._keep())
        self.names.setCurrentRow(0)
        self._show(self.names.currentRow())

    def add(self) -> None:
        """Add an object at the end."""
        self._typed.append(NEW)
        self.names.addItem(self._typed[-1].name)
        self.names.setCurrentRow(len(self._typed) - 1)

    def remove(self) -> None:
        """Remove the chosen object."""
        row = self.names.currentRow()
        if row >= 0:
            del self._typed[row]
            with QSignalBlocker(self.names):
                self.names.takeItem(row)
            self._show(self.names.currentRow())

    def _show(self, row: int) -> None:
        self.form.setEnabled(row >= 0)
        self.form.show_value(self._typed[row] if row >= 0 else NEW)

    def _keep(self) -> None:
        row = self.names.currentRow()
        self._typed[row] = self.form.value
        self.names.item(row).setText(self.form.value.name)

    def accept(self) -> None:
        """Accept the list, or show its first error."""
        for row, typed in enumerate(self._typed):
            try:
                check_named(typed)
            except InputError as error:
                self.names.setCurrentRow(row)
                self.problem.setText(str(error))
                return
        self.indenters = tuple(self._typed)
        super().accept()
