"""Asks what is true of the tool that is chosen, and says how far the measurement is off."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.measure.figures_text import UNITS
from app.measure.judging import Judged, Stated
from app.measure.placing import INDENTERS
from app.widgets.label import MarkupLabel, escaped
from app.widgets.naming import named
from app.workspace.indenters import Indenter
from gelpolight_core.measurement.tools import ToolResult
from gelpolight_core.translation import tr


class TruthForm(QGroupBox):
    """The truth of what is measured: typed, or that of a known indenter.

    Signals
    -------
    changed()
        Something else is stated.
    indenters_wanted()
        The list of indenters shall be edited.
    limits_wanted()
        The limits shall be edited.
    """

    changed = Signal()
    indenters_wanted = Signal()
    limits_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(tr("True size"), parent)
        named(self, "measure.truth", tr("True size"))
        self._kind = ""
        self._kept: dict[str, Stated] = {}
        self._indenters: tuple[Indenter, ...] = ()
        self.known = named(QComboBox(), "measure.truth.known", tr("Known indenter"))
        self.size_on = named(
            QCheckBox(tr("Diameter")), "measure.truth.size_on", tr("The size is known")
        )
        self.size = _spin("measure.truth.size", tr("True size"), 5.0)
        self.height_on = named(
            QCheckBox(tr("Depth")), "measure.truth.height_on", tr("The depth is known")
        )
        self.height = _spin("measure.truth.height", tr("True depth"), 1.0)
        self.verdict = named(MarkupLabel(), "measure.truth.verdict", tr("Error and verdict"))
        self.verdict.setWordWrap(True)
        self._lay_out()
        for box, spin in ((self.size_on, self.size), (self.height_on, self.height)):
            spin.setEnabled(False)
            box.toggled.connect(spin.setEnabled)
            box.toggled.connect(self._on_typed)
            spin.valueChanged.connect(self._on_typed)
        self.known.activated.connect(self._on_known)
        self.show_kind("", "", "mm")

    def _lay_out(self) -> None:
        edit = named(
            QPushButton(tr("Edit list…")), "measure.truth.edit", tr("Edit the known indenters")
        )
        edit.clicked.connect(self.indenters_wanted)
        limits = named(QPushButton(tr("Limits…")), "measure.truth.limits", tr("Edit the limits"))
        limits.clicked.connect(self.limits_wanted)
        for button in (edit, limits):
            button.setAutoDefault(False)
        self._form = QFormLayout()
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._form.addRow(self.known)
        self._form.addRow(self.size_on, self.size)
        self._form.addRow(self.height_on, self.height)
        row = QHBoxLayout()
        row.addWidget(edit)
        row.addWidget(limits)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.addLayout(self._form)
        column.addLayout(row)
        column.addWidget(self.verdict)

    # What is stated

    @property
    def stated(self) -> Stated:
        """What is said to be true of the tool that is chosen."""
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

    def show_kind(self, kind: str, label: str, unit: str) -> None:
        """Ask for the truth of a kind of tool; what was stated of it before is still there.

        Parameters
        ----------
        kind : str
            Name of the tool; empty where none is chosen.
        label, unit : str
            Of the length that is asked for.
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

    def state(self, stated: Stated) -> None:
        """State something, as by typing it."""
        self._show(stated)
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
        """Return what the list says of an indenter; None where it does not know it."""
        for indenter in self._indenters:
            if (indenter.shape, indenter.name) == (kind, name):
                return Stated(indenter.mean_size_mm, indenter.height_mm, name)
        return None

    def _on_known(self) -> None:
        found = self._listed(self._kind, self.known.currentData())
        if found is not None:
            self._show(found)
        self.changed.emit()

    def _on_typed(self) -> None:
        # What is typed is no longer what the list says.
        with QSignalBlocker(self.known):
            self.known.setCurrentIndex(0)
        self.changed.emit()

    # How it compares

    def show_verdict(self, rows: tuple[Judged, ...], result: ToolResult | None) -> None:
        """Say how far the measurement is off; no rows: what to do to learn it."""
        if not rows:
            text = tr("State what is true to see the error.") if result is not None else ""
            self._say(text, "muted")
            return
        self.verdict.setText("<br>".join(_sentence(row) for row in rows))

    def show_refusal(self, sentence: str) -> None:
        """Say why nothing can be compared."""
        self._say(sentence, "fail")

    def _say(self, text: str, role: str) -> None:
        self.verdict.setText(f"<span style='color:@{role}'>{escaped(text)}</span>")


def _sentence(row: Judged) -> str:
    role = "pass" if row.passed else "fail"
    return tr(
        "{label}: {error:+.3f}{unit}, <b style='color:@{role}'>{percent:+.2f} %: {word}"
        " {limit:g} %</b>"
    ).format(
        label=escaped(row.label[:1].upper() + row.label[1:]),
        error=row.error,
        unit=escaped(UNITS.get(row.unit, row.unit)),
        role=role,
        percent=row.error_percent,
        word=tr("within") if row.passed else tr("beyond"),
        limit=row.limit_percent,
    )


def _spin(name: str, accessible: str, value: float) -> QDoubleSpinBox:
    box = named(QDoubleSpinBox(), name, accessible)
    box.setDecimals(3)
    box.setRange(0.001, 500.0)
    box.setSingleStep(0.1)
    box.setSuffix(UNITS["mm"])
    box.setValue(value)
    return box
