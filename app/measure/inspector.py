"""The inspector: what was measured beside its reference, and the buttons at their fixed places."""

from __future__ import annotations

from dataclasses import dataclass, replace

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QCheckBox, QWidget

from app.widgets.actions import Slot, action_button, tool_button
from app.widgets.collapsible_section import CollapsibleSection
from app.widgets.forms import Form
from app.widgets.inputs import ComboBox, NumberField
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, side_panel, vbox
from app.widgets.status_icon import busy_bar
from app.widgets.text_roles import heading, named_label, set_background_role, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import unit_behind
from gelpolight_core.base.form_fields import text
from gelpolight_core.base.user_name import user_name
from gelpolight_core.session.reference_object import LENGTHS, ReferenceObject

from .press_state import PressState, ResultRow

AGAIN = "\0again"
"""The entry that states the values of the press before. No name of an object is like it."""


class ReferenceForm(QWidget):
    """The true values.

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
        self._given: tuple[ReferenceObject, ...] = ()
        box = ComboBox(characters=12)
        self.known = set_names(box, "measure.reference.known", "Known object")
        self.known.activated.connect(lambda _index: self._on_known())
        edit = tool_button("measure.reference.edit", "Edit…", on_edit, tip="Edit the known objects")
        self.form = Form(ReferenceObject(""), "measure.reference", only=LENGTHS, narrow=True)
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
        self._given = () if known is None else (known,)
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
        for name in ("size_mm", "size_expanded_mm"):
            if isinstance(field := self.form.inputs[name], NumberField):
                field.setSuffix(unit_behind(state.unit))

    def state(self, stated: ReferenceObject) -> None:
        """Enter values from code, as if the user had chosen them."""
        self.form.show_value(stated)
        self._offer()
        self._on_changed()

    def _offer(self) -> None:
        """Show the known objects of the kind, and the values of the press before."""
        before = [("Same as the press before", AGAIN)] if self._kind in self._before else []
        known = (*self._given, *self._objects)
        names = [listed.name for listed in known if listed.shape == self._kind]
        own = "No known object" if self.stated == ReferenceObject(self._kind) else "Own values"
        entries = [(own, ""), *before, *((name, name) for name in names)]
        self.known.offer(entries, self.stated.name)

    def _listed(self, kind: str, name: str) -> ReferenceObject | None:
        """Return the listed values of an object, or None if it is not in the list."""
        listed = {(one.shape, one.name): one for one in (*self._objects, *self._given)}
        return listed.get((kind, name))

    def _on_known(self) -> None:
        name = self.known.currentData()
        if name == AGAIN:
            self.state(self._before[self._kind])
        else:
            self.state(self._listed(self._kind, name) or ReferenceObject(self._kind))

    def _on_typed(self) -> None:
        """Forget the known object: its values are no longer those."""
        self.form.value = replace(self.form.value, name="", certificate="", due="", serial="")
        self._offer()
        self._on_changed()


HEADS = "measured", "reference", "deviation"
LEAST_PX, MOST_PX = 272, 380
HEAD = "font-size: 11px; color: @muted"


@dataclass(frozen=True, slots=True)
class OperatorNote:
    """Operator and note of a measurement."""

    operator: str = text("", "Operator")
    note: str = text("", "Note", example="Any remark")


class Inspector(QWidget):
    """Shows the state of a press.

    Parameters
    ----------
    freeze, save : QAction
        Actions of the buttons at the lower end.
    bench : QWidget
        The controls of the virtual sensor.
    on_reference, on_edit, on_records : callable
        Called when the user states another reference, wants to edit the known objects, and wants
        to see the records.
    """

    def __init__(
        self,
        freeze: QAction,
        save: QAction,
        bench: QWidget,
        *,
        on_reference: Slot,
        on_edit: Slot,
        on_records: Slot,
    ) -> None:
        super().__init__()
        set_names(self, "measure.panel", "Result")
        self.title = named_label("measure.title", "Chosen tool", wrap=False, bold=1.5)
        self.verdict = named_label("measure.verdict", "Verdict", wrap=False)
        self.verdict.setStyleSheet("border-radius: 8px; padding: 3px 8px")
        self.image = named_label("measure.image", "Measured image", role="muted")
        self.table = set_names(MarkupLabel(wrap=True), "measure.figures", "Figures of the tool")
        self.table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.sources = set_names(
            MarkupLabel(), "measure.sources", "Standard uncertainties by source"
        )
        self.budget = CollapsibleSection("measure.budget", "Uncertainty budget", self.sources)
        self.reason = named_label("measure.reason", "Why it is doubtful")
        self.reference = ReferenceForm(on_reference, on_edit)
        self.remarks = Form(OperatorNote(user_name()), "measure")
        self.bench = CollapsibleSection("measure.bench", "Virtual bench", bench)
        words = "Freeze the image and detect the object when a press is steady"
        self.auto = set_names(QCheckBox("Freeze when steady"), "measure.auto", words)
        self.auto.setChecked(True)
        self.busy = busy_bar("measure.busy", "Measuring")
        self.message = set_names(MarkupLabel(wrap=True), "measure.message", "Last answer")
        self.message.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.message.hide()
        self.message.linkActivated.connect(lambda _link: on_records())
        head = hbox((self.title, 1), (self.verdict, 0, Qt.AlignmentFlag.AlignTop), spacing=8)
        panel = side_panel(
            (
                vbox(head, self.image, spacing=2),
                vbox(self.table, self.budget, spacing=2),
                self.reason,
                vbox(heading("Reference"), self.reference, spacing=4),
                CollapsibleSection("measure.remarks", "Operator and note", self.remarks),
                self.bench,
            ),
            (
                self.message,
                self.busy,
                self.auto,
                action_button(freeze),
                action_button(save, primary=True),
            ),
        )
        for part in (self, panel):
            part.setMinimumWidth(LEAST_PX)
            part.setMaximumWidth(MOST_PX)
        vbox(panel, of=self, margins=0)

    def show_state(self, state: PressState) -> None:
        """Show what was measured."""
        live = ("Live", "Press Space to freeze the image.") if state.freezable else ("No depth", "")
        title, about = ("No tool", state.image) if state.frozen else live
        self.title.setText(state.title or title)
        self.image.setText(about)
        self.verdict.setVisible(bool(state.verdict))
        self.verdict.setText(state.verdict)
        set_background_role(self.verdict, state.verdict_role)
        self.table.setText(_table(state.rows))
        self.budget.setVisible(bool(state.budget))
        self.sources.setText(_lines(state.budget))
        self.reason.setText(state.reason)
        self.reason.setVisible(bool(state.reason))
        set_text_role(self.reason, state.role)
        self.reference.show_state(state)
        self.busy.setVisible(state.reconstructing or state.detecting)

    def show_message(self, text: str, role: str = "", *, link: str = "") -> None:
        """Show an answer of the program, until the next one."""
        self.message.setVisible(bool(text))
        words = escaped(text)
        if role:
            words = f"<span style='color:@{role}'>{words}</span>"
        self.message.setText(f"{words} <a href='#'>{escaped(link)}</a>" if link else words)


def _table(rows: tuple[ResultRow, ...]) -> str:
    if not rows:
        return ""
    has_reference = any(row.reference for row in rows)
    heads = HEADS if has_reference else (HEADS[0], "", "")
    cells = "".join(_cell(f"<span style='{HEAD}'>{escaped(head)}</span>") for head in heads)
    body = "".join(map(_row, rows))
    return (
        f"<table width='100%' cellspacing='0' cellpadding='1'><tr><td></td>{cells}</tr>{body}"
        "</table><span style='color:@muted'>mm; ± one standard deviation</span>"
    )


def _lines(budget: tuple[tuple[str, ...], ...]) -> str:
    rows = (f"<td>{escaped(name)}</td>{''.join(map(_cell, row))}" for name, *row in budget)
    return f"<table width='100%' cellpadding='1'><tr>{'</tr><tr>'.join(rows)}</tr></table>"


def _row(row: ResultRow) -> str:
    label = f"<td>{escaped(row.label)}</td>"
    if not row.reference:
        sd = f"<td colspan='2' style='white-space:nowrap;color:@muted'>{row.sd}</td>"
        return f"<tr>{label}{_cell(row.measured)}{sd}</tr>"
    first = "".join(map(_cell, (row.measured, row.reference, row.deviation)))
    second = _cell(row.sd, "muted") + _cell("") + _cell(row.percent, row.role)
    colour = f"color:@{row.role}" if row.role else ""
    third = f"<td colspan='4' align='right' style='{colour}'>{row.decision}</td>"
    return f"<tr>{label}{first}</tr><tr><td></td>{second}</tr><tr>{third}</tr>"


def _cell(text: str, role: str = "") -> str:
    colour = f"color:@{role}" if role else ""
    return f"<td align='right' style='white-space:nowrap;{colour}'>{text}</td>"
