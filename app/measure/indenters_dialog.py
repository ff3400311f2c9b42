"""Dialog to edit the list of known objects."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QListWidget, QWidget

from app.measure.placing import INDENTERS, kind_label
from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.fields import choice, number, text
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from app.workspace.indenters import OPTIONAL, Indenter
from app.workspace.reference import LARGEST_MM, MM, Reference, optional_length
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

NOT_OF_A_BALL = ("second_mm", "edge_radius_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Typed(Reference):
    """A known object as it is typed. 0: not stated."""

    name: str = text("", tr("Name"))
    shape: str = choice("cylinder", tr("Shape"), {name: kind_label(name) for name in INDENTERS})
    size_mm: float = number(5.0, tr("Diameter or side"), 0.0, LARGEST_MM, MM, 3)
    second_mm: float = optional_length(
        tr("Other side"), tr("the same"), when=lambda typed: typed.shape == "cuboid"
    )
    height_mm: float = optional_length(
        tr("Depth"),
        tr("not known"),
        tip=tr("Height of the object from its face to its base, if it has one"),
    )
    edge_radius_mm: float = optional_length(
        tr("Edge radius"), tr("not known"), when=lambda typed: typed.shape != "ball"
    )
    certificate: str = text("", tr("Certificate"), tr("Number of its calibration certificate"))
    due: str = text("", tr("Due on"), tr("End of its calibration, such as 2027-03-31"))
    serial: str = text("", tr("Serial number"))

    def indenter(self) -> Indenter:
        """Return the object.

        Raises
        ------
        InputError
            If it has no name or no size, or a day that is none.
        """
        values = asdict(self) | {"name": self.name.strip()}
        stated = {name: values[name] or None for name in OPTIONAL}
        for name in {"cuboid": (), "cylinder": ("second_mm",)}.get(self.shape, NOT_OF_A_BALL):
            stated[name] = None
        return Indenter(**values | stated)


class IndentersDialog(Dialog):
    """Edits the list. Errors are shown below it, and an invalid list is not accepted.

    Attributes
    ----------
    indenters : tuple of Indenter
        The accepted list.
    """

    def __init__(self, indenters: tuple[Indenter, ...], parent: QWidget | None = None) -> None:
        kinds = Kinds.Save | Kinds.Cancel
        super().__init__(parent, "measure.indenters", tr("Known objects"), kinds, once=True)
        self.resize(560, 360)
        self.indenters = indenters
        self._typed = [
            Typed(**{name: value for name, value in asdict(i).items() if value is not None})
            for i in indenters
        ]
        self.names = named(QListWidget(), "measure.indenters.names", tr("Known objects"))
        self.form = Form(Typed(), "measure.indenters", at_once=True)
        self.problem = named(
            PlainLabel(wrap=True), "measure.indenters.problem", tr("Errors in the list")
        )
        show_meaning(self.problem, "fail")
        add = push_button("measure.indenters.add", tr("&Add"), self.add, icon_name="add")
        remove = push_button(
            "measure.indenters.remove", tr("&Remove"), self.remove, icon_name="remove"
        )
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
        self._typed.append(Typed(name=tr("New cylinder")))
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
        self.form.show_value(self._typed[row] if row >= 0 else Typed())

    def _keep(self) -> None:
        row = self.names.currentRow()
        self._typed[row] = self.form.value
        self.names.item(row).setText(self.form.value.name)

    def accept(self) -> None:
        """Accept the list, or show its first error."""
        for row, typed in enumerate(self._typed):
            try:
                typed.indenter()
            except InputError as error:
                self.names.setCurrentRow(row)
                self.problem.setText(str(error))
                return
        self.indenters = tuple(typed.indenter() for typed in self._typed)
        super().accept()
