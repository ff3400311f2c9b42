"""Asks for the true values of the chosen tool: typed, or of a known object."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QWidget

from app.widgets.buttons import Slot, tool_button
from app.widgets.forms import Form
from app.widgets.inputs import ComboBox, NumberField
from app.widgets.layout import hbox, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import unit_behind
from gelpolight_core.session.reference_object import LENGTHS, ReferenceObject

from .press_state import PressState

LEAST_PX = 74
AGAIN = "\0again"
"""The entry that states the values of the press before. No name of an object is like it."""


class ReferenceForm(QWidget):
    """Form for the true values of the chosen tool.

    Parameters
    ----------
    on_changed : callable
        Called when the user has stated other values.
    on_edit : callable
        Called to edit the list of known objects.
    """

    def __init__(self, on_changed: Slot, on_edit: Slot) -> None:
        super().__init__()
        set_names(self, "measure.reference", "Reference")
        self._on_changed = on_changed
        self._kind = ""
        self._kept: dict[str, ReferenceObject] = {}
        self._before: dict[str, ReferenceObject] = {}
        self._objects: tuple[ReferenceObject, ...] = ()
        self.known = set_names(ComboBox(), "measure.reference.known", "Known object")
        self.known.setMinimumContentsLength(12)
        self.known.setSizeAdjustPolicy(
            ComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.known.activated.connect(lambda _index: self._on_known())
        edit = tool_button("measure.reference.edit", "Edit…", on_edit, tip="Edit the known objects")
        self.form = Form(ReferenceObject(""), "measure.reference", only=LENGTHS)
        for field in self.form.inputs.values():
            field.setMinimumWidth(LEAST_PX)
        self.form.changed.connect(lambda _name, _value: self._on_typed())
        vbox(hbox((self.known, 1), edit, spacing=4), self.form, of=self, margins=0)

    @property
    def stated(self) -> ReferenceObject:
        """The true values of the chosen tool."""
        return self.form.value

    def stated_for(self, kind: str) -> ReferenceObject:
        """Return the true values of a kind of tool on this press."""
        return self.stated if kind == self._kind else self._kept.get(kind, ReferenceObject(kind))

    def show_objects(self, objects: tuple[ReferenceObject, ...]) -> None:
        """Offer these known objects, and use what is corrected in the list."""
        self._objects = objects
        for kind, truth in {**self._kept, self._kind: self.stated}.items():
            if (listed := self._listed(kind, truth.name)) is not None:
                self._kept[kind] = listed
                if kind == self._kind:
                    self.state(listed)
        self._offer()

    def new_press(self, known: ReferenceObject | None = None) -> None:
        """Clear the true values: the next press can be of another object. They are offered.

        Parameters
        ----------
        known : ReferenceObject, optional
            The next object, where the program knows it.
        """
        truths = {**self._kept, self._kind: self.stated}
        self._before |= {
            kind: truth for kind, truth in truths.items() if truth != ReferenceObject(kind)
        }
        self._kept = {} if known is None else {known.shape: known}
        self.state(self._kept.get(self._kind, ReferenceObject(self._kind)))

    def show_state(self, state: PressState) -> None:
        """Ask for the true values of the chosen tool. Those of this press are restored."""
        if state.kind != self._kind:
            self._kept[self._kind] = self.stated
            self._kind = state.kind
            self.form.show_value(self._kept.get(state.kind, ReferenceObject(state.kind)))
            self._offer()
        self.setEnabled(bool(state.kind))
        self.form.rename_row("size_mm", state.asked or "Size")
        if isinstance(field := self.form.inputs["size_mm"], NumberField):
            field.setSuffix(unit_behind(state.unit))

    def state(self, stated: ReferenceObject) -> None:
        """Enter values from code, as if the user had chosen them."""
        self.form.show_value(stated)
        self._offer()
        self._on_changed()

    def _offer(self) -> None:
        """Show the known objects of the kind, and the values of the press before."""
        with QSignalBlocker(self.known):
            self.known.clear()
            self.known.addItem("No known object", "")
            if self._kind in self._before:
                self.known.addItem("Same as the press before", AGAIN)
            for reference in self._objects:
                if reference.shape == self._kind:
                    self.known.addItem(reference.name, reference.name)
            self.known.setCurrentIndex(max(self.known.findData(self.stated.name), 0))

    def _listed(self, kind: str, name: str) -> ReferenceObject | None:
        """Return the listed values of an object, or None if it is not in the list."""
        listed = (
            reference
            for reference in self._objects
            if (reference.shape, reference.name) == (kind, name)
        )
        return next(listed, None)

    def _on_known(self) -> None:
        name = self.known.currentData()
        if name == AGAIN:
            self.state(self._before[self._kind])
        else:
            self.state(self._listed(self._kind, name) or ReferenceObject(self._kind))

    def _on_typed(self) -> None:
        """Forget the known object: its values are no longer those."""
        self.form.value = replace(self.form.value, name="", certificate="", due="", serial="")
        with QSignalBlocker(self.known):
            self.known.setCurrentIndex(0)
        self._on_changed()
