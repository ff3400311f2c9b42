"""Asks for the true values of the chosen tool, and shows the measurement's error."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QFormLayout,
    QGroupBox,
    QPushButton,
)

from app.measure.figures_text import UNITS
from app.measure.judging import Stated
from app.measure.placing import INDENTERS
from app.widgets.inputs import ComboBox, DoubleSpinBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from app.workspace.indenters import Indenter
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.translation import tr


class TruthForm(QGroupBox):
    """The true values: typed, or those of a known indenter.

    Attributes
    ----------
    edit, limits : QPushButton
        To edit the list of indenters, and the limits. Connected by the page.

    Signals
    -------
    changed()
        The true values changed.
    """

    changed = Signal()

    def __init__(self) -> None:
        super().__init__(tr("True size"))
        named(self, "measure.truth", tr("True size"))
        self._kind = ""
        self._kept: dict[str, Stated] = {}
        self._before: dict[str, Stated] = {}
        self._indenters: tuple[Indenter, ...] = ()
        self.known = named(ComboBox(), "measure.truth.known", tr("Known indenter"))
        self.known.activated.connect(self._on_known)
        self._form = QFormLayout()
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._form.addRow(self.known)
        self.size_on, self.size = self._add_length(
            "size", tr("Diameter"), tr("Use the true size"), tr("True size"), 5.0
        )
        self.height_on, self.height = self._add_length(
            "height", tr("Depth"), tr("Use the true depth"), tr("True depth"), 1.0
        )
        self.again = _button(
            "again",
            tr("Same object as before"),
            tr("Use the true values of the previous press"),
            tr("True values are not copied to the next press automatically"),
        )
        self.again.clicked.connect(self._use_again)
        self.edit = _button("edit", tr("Edit list…"), tr("Edit the known indenters"))
        self.limits = _button("limits", tr("Limits…"), tr("Edit the limits"))
        self.verdict = named(
            MarkupLabel(wrap=True), "measure.truth.verdict", tr("Error and verdict")
        )
        buttons = hbox(self.edit, self.limits, None)
        vbox(self._form, self.again, buttons, self.verdict, of=self)
        self.show_kind("", "", "mm")

    def _add_length(
        self, name: str, text: str, use: str, accessible: str, value: float
    ) -> tuple[QCheckBox, DoubleSpinBox]:
        """Add the row of a length, which is used if its box is checked."""
        box = named(QCheckBox(text), f"measure.truth.{name}_on", use)
        spin = named(
            DoubleSpinBox(decimals=3, minimum=0.001, maximum=500.0, singleStep=0.1, value=value),
            f"measure.truth.{name}",
            accessible,
        )
        spin.setSuffix(UNITS["mm"])
        spin.setEnabled(False)
        box.toggled.connect(spin.setEnabled)
        box.toggled.connect(self._on_typed)
        spin.valueChanged.connect(self._on_typed)
        self._form.addRow(box, spin)
        return box, spin

    # True values

    @property
    def stated(self) -> Stated:
        """The true values of the chosen tool."""
        name = self.known.currentData() or ""
        return Stated(
            self.size.value() if self.size_on.isChecked() else None,
            self.height.value() if self.height_on.isChecked() and self._is_indenter else None,
            name,
        )

    @property
    def _is_indenter(self) -> bool:
        return self._kind in INDENTERS

    def show_indenters(self, indenters: tuple[Indenter, ...]) -> None:
        """Offer these known indenters."""
        self._indenters = indenters
        self._fill_known()
        for kind, stated in self._kept.items():
            self._kept[kind] = self._listed(kind, stated.name) or stated
        found = self._listed(self._kind, self.known.currentData())
        if found is not None:
            self.state(found)

    def new_press(self) -> None:
        """Clear the true values: the next press can be of another object or depth.

        A button offers them for this press, too.
        """
        if self._kind:
            self._kept[self._kind] = self.stated
        self._before |= {kind: stated for kind, stated in self._kept.items() if stated != Stated()}
        self._kept = {}
        self._show(Stated())
        self._offer_again()
        self.changed.emit()

    def _offer_again(self) -> None:
        """Offer the values of the press before while none are entered."""
        before = self._before.get(self._kind)
        self.again.setVisible(before is not None and self.stated == Stated())

    def _use_again(self) -> None:
        self.state(self._before[self._kind])

    def show_kind(self, kind: str, label: str, unit: str) -> None:
        """Ask for the true values of a kind of tool. Those of this press are restored.

        Parameters
        ----------
        kind : str
            Name of the tool. Empty if none is chosen.
        label, unit : str
            Of the requested length.
        """
        if kind != self._kind:
            if self._kind:
                self._kept[self._kind] = self.stated
            self._kind = kind
            self._fill_known()
            self._show(self._kept.get(kind, Stated()))
        self.setEnabled(bool(kind))
        self.size_on.setText(label[:1].upper() + label[1:] if label else tr("Size"))
        self.size.setSuffix(UNITS.get(unit, unit))
        self.known.setVisible(self._is_indenter)
        self._form.setRowVisible(self.height_on, self._is_indenter)
        self._offer_again()

    def state(self, stated: Stated) -> None:
        """Enter values from code, as if typed."""
        self._show(stated)
        self._offer_again()
        self.changed.emit()

    def _show(self, stated: Stated) -> None:
        boxes = (self.size_on, self.size, self.height_on, self.height, self.known)
        blocked = [QSignalBlocker(box) for box in boxes]
        for box, spin, value in (
            (self.size_on, self.size, stated.size_mm),
            (self.height_on, self.height, stated.height_mm),
        ):
            box.setChecked(value is not None)
            spin.setEnabled(value is not None)
            if value is not None:
                spin.setValue(value)
        self.known.setCurrentIndex(max(self.known.findData(stated.name), 0))
        del blocked

    def _fill_known(self) -> None:
        with QSignalBlocker(self.known):
            chosen = self.known.currentData()
            self.known.clear()
            self.known.addItem(tr("Not a known indenter"), "")
            for indenter in self._indenters:
                if indenter.shape == self._kind:
                    self.known.addItem(indenter.name, indenter.name)
            self.known.setCurrentIndex(max(self.known.findData(chosen), 0))

    def _listed(self, kind: str, name: str) -> Stated | None:
        """Return the listed values of an indenter, or None if it is not in the list."""
        for indenter in self._indenters:
            if (indenter.shape, indenter.name) == (kind, name):
                return Stated(indenter.mean_size_mm, indenter.height_mm, name)
        return None

    def _on_known(self) -> None:
        self.state(self._listed(self._kind, self.known.currentData()) or self.stated)

    def _on_typed(self) -> None:
        # The typed values no longer match the list.
        with QSignalBlocker(self.known):
            self.known.setCurrentIndex(0)
        self._offer_again()
        self.changed.emit()

    # Comparison

    def show_verdict(self, findings: tuple[Finding, ...]) -> None:
        """Show the errors of the measurement. Without any: show what to do to see them."""
        if findings:
            self.verdict.setText("<br>".join(map(_sentence, findings)))
        else:
            self.say(tr("Enter the true values to see the error."))

    def say(self, text: str, role: str = "muted") -> None:
        """Show a text in place of the errors."""
        self.verdict.setText(f"<span style='color:@{role}'>{escaped(text)}</span>")


def _sentence(finding: Finding) -> str:
    return tr("{text}, <b style='color:@{role}'>{percent:+.2f} %: {word} {limit:g} %</b>").format(
        text=escaped(finding.text[:1].upper() + finding.text[1:]),
        role=finding.verdict.value,
        percent=finding.value,
        word=tr("within") if finding.verdict is Verdict.PASS else tr("outside"),
        limit=finding.fail_limit,
    )


def _button(name: str, text: str, accessible: str, tip: str = "") -> QPushButton:
    button = named(QPushButton(text, autoDefault=False), f"measure.truth.{name}", accessible, tip)
    return button
