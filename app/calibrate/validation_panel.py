"""The validation step's side panel: what is pressed, its true size, and how it was measured."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.assembly import AssemblyPicture
from app.calibrate.step_panel import WIDTH, lay_button, side_scroll
from app.calibrate.steps import Step
from app.calibrate.trial import KnownObject, Trial
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr


class ValidationPanel(QWidget):
    """Asks for the known object, and shows how the trial went.

    Signals
    -------
    lay_wanted()
        Put on the virtual bench what this step asks for.
    trial_wanted()
        Capture and measure now.
    import_wanted()
        Measure the picture of a press from a file.
    keep_wanted()
        Record the trial as this calibration's validation.
    """

    lay_wanted = Signal()
    trial_wanted = Signal()
    import_wanted = Signal()
    keep_wanted = Signal()

    def __init__(self, step: Step, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "validation", tr("Validation"))
        self.setFixedWidth(WIDTH)
        self._has_calibration = self._has_camera = False
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 0, 0)
        scroll, inside = side_scroll("validation.scroll", tr("Validation"))
        outer.addWidget(scroll)
        column = QVBoxLayout(inside)
        column.setContentsMargins(12, 10, 12, 10)
        title = PlainLabel(step.title)
        make_bold(title, size=1.35)
        picture = AssemblyPicture()
        picture.show_assembly(step.assembly)
        task = PlainLabel(step.task)
        task.setWordWrap(True)
        self.calibration = named(PlainLabel(), "validation.calibration", tr("Calibration tried"))
        self.calibration.setWordWrap(True)
        for widget in (title, picture, task, self.calibration):
            column.addWidget(widget)
        column.addLayout(self._build_form())
        self.lay = lay_button("validation.lay")
        self.lay.clicked.connect(self.lay_wanted)
        column.addWidget(self.lay)
        self.measure = named(
            QPushButton(tr("&Measure the press")),
            "validation.measure",
            tr("Measure what is pressed in"),
        )
        self.measure.setMinimumHeight(38)
        self.measure.clicked.connect(self.trial_wanted)
        self.import_press = named(
            QPushButton(tr("&Import…")),
            "validation.import",
            tr("Measure a press from a picture file"),
            tr("Its true size is taken from a truth.csv beside it, where there is one"),
        )
        self.import_press.clicked.connect(self.import_wanted)
        row = QHBoxLayout()
        row.addWidget(self.measure, 2)
        row.addWidget(self.import_press, 1)
        column.addLayout(row)
        self.blocked = named(PlainLabel(), "validation.blocked", tr("Why nothing can be measured"))
        self.blocked.setWordWrap(True)
        column.addWidget(self.blocked)
        self.progress = named(QProgressBar(), "validation.progress", tr("Progress"))
        self.progress.setRange(0, 100)
        keep = self.progress.sizePolicy()
        keep.setRetainSizeWhenHidden(True)
        self.progress.setSizePolicy(keep)
        self.progress.hide()
        column.addWidget(self.progress)
        self.result = named(MarkupLabel(), "validation.result", tr("Result"))
        self.result.setWordWrap(True)
        column.addWidget(self.result)
        self.keep = named(
            QPushButton(tr("&Record this validation")),
            "validation.keep",
            tr("Record this validation"),
        )
        self.keep.setMinimumHeight(34)
        self.keep.clicked.connect(self.keep_wanted)
        column.addWidget(self.keep)
        self.verdict = named(PlainLabel(), "validation.verdict", tr("Validated or not"))
        self.verdict.setWordWrap(True)
        make_bold(self.verdict)
        column.addWidget(self.verdict)
        column.addStretch(1)
        self.show_trial(None)

    def _build_form(self) -> QFormLayout:
        form = QFormLayout()
        self.shape = named(QComboBox(), "validation.shape", tr("Shape"))
        for name, text in (
            ("cylinder", tr("Cylinder, flat end")),
            ("cuboid", tr("Cuboid, flat end")),
            ("ball", tr("Ball")),
        ):
            self.shape.addItem(text, name)
        self.size = _length("validation.size", tr("True diameter or side"), 5.0)
        self.height_known = named(
            QCheckBox(tr("Depth is known")),
            "validation.height_known",
            tr("The depth of the press is known"),
        )
        self.height = _length("validation.height", tr("True depth of the press"), 1.0)
        self.height.setEnabled(False)
        self.height_known.toggled.connect(self.height.setEnabled)
        self.size_limit = _percent("validation.size_limit", tr("Limit of the size"), 5.0)
        self.height_limit = _percent("validation.height_limit", tr("Limit of the depth"), 8.0)
        form.addRow(tr("Shape"), self.shape)
        form.addRow(tr("True diameter or side"), self.size)
        form.addRow(self.height_known, self.height)
        form.addRow(tr("Largest error of the size"), self.size_limit)
        form.addRow(tr("Largest error of the depth"), self.height_limit)
        return form

    def known(self) -> KnownObject:
        """Return the object as stated."""
        height = self.height.value() if self.height_known.isChecked() else None
        return KnownObject(self.shape.currentData(), self.size.value(), height)

    def show_known(self, known: KnownObject) -> None:
        """State an object, as where the virtual bench knows what lies there."""
        self.shape.setCurrentIndex(max(self.shape.findData(known.shape), 0))
        self.size.setValue(known.size_mm)
        self.height_known.setChecked(known.height_mm is not None)
        if known.height_mm is not None:
            self.height.setValue(known.height_mm)

    def show_calibration(self, name: str, *, present: bool) -> None:
        """Say which calibration is tried.

        Parameters
        ----------
        name : str
            Its name; empty where none is saved yet.
        present : bool
            Whether it was made from the captures and corrections as they are now.
        """
        said = tr("Calibration: {name}, of the present captures.")
        if not name:
            said = tr("Save the calibration first (step 10): a validation belongs to one.")
        elif not present:
            said = tr("Calibration: {name}. What it was made from has changed: save it anew.")
        self.calibration.setText(said.format(name=name))
        show_meaning(self.calibration, "" if present else "warn")
        self._has_calibration = bool(name)
        self._allow()

    def show_camera(self, there: bool) -> None:
        """Offer to measure only where there is a camera."""
        self._has_camera = there
        self._allow()

    def _allow(self) -> None:
        self.measure.setEnabled(self._has_calibration and self._has_camera)
        self.import_press.setEnabled(self._has_calibration)
        why = ""
        if self._has_calibration and not self._has_camera:
            why = tr("No camera: choose one in the bar above, or import a picture.")
        self.blocked.setText(why)
        self.blocked.setVisible(bool(why))

    def show_work(self, share: float | None) -> None:
        """Show progress; None when nothing runs."""
        self.progress.setVisible(share is not None)
        self.progress.setValue(round(100 * (share or 0.0)))

    def show_trial(self, trial: Trial | None) -> None:
        """Show how a trial went."""
        self.keep.setEnabled(trial is not None)
        if trial is None:
            self.say("")
            return
        rows = []
        for c in trial.comparisons:
            word = tr("within") if c.passed else tr("beyond")
            rows.append(
                tr(
                    "<b>{what}</b>: measured {m:.3f} mm, true {t:.3f} mm, error"
                    " <b>{e:+.2f} %</b>, {word} ±{limit:g} %"
                ).format(
                    what=escaped(c.quantity.capitalize()),
                    m=c.measured_mm,
                    t=c.true_mm,
                    e=c.error_percent,
                    word=word,
                    limit=c.limit_percent,
                )
            )
        if trial.measurement.verdict != "ok":
            rows.append(escaped(tr("Doubtful: {reason}").format(reason=trial.measurement.reason)))
        passed = all(c.passed for c in trial.comparisons)
        self._show_result("<br>".join(rows), "pass" if passed else "fail")

    def say(self, sentence: str, meaning: str = "") -> None:
        """Say how a trial gets on, or why it came to nothing."""
        self._show_result(escaped(sentence), meaning)

    def _show_result(self, markup: str, meaning: str) -> None:
        self.result.setText(markup)
        show_meaning(self.result, meaning)

    def show_verdict(self, text: str, *, passed: bool) -> None:
        """Say whether the calibration is validated."""
        self.verdict.setText(text)
        show_meaning(self.verdict, "pass" if passed else "fail")


def _length(name: str, accessible: str, value: float) -> QDoubleSpinBox:
    box = named(QDoubleSpinBox(), name, tr("{what} in mm").format(what=accessible))
    box.setDecimals(3)
    box.setRange(0.01, 500.0)
    box.setSingleStep(0.1)
    box.setSuffix(tr(" mm"))
    box.setValue(value)
    return box


def _percent(name: str, accessible: str, value: float) -> QDoubleSpinBox:
    box = named(QDoubleSpinBox(), name, tr("{what} in percent").format(what=accessible))
    box.setDecimals(1)
    box.setRange(0.1, 100.0)
    box.setSuffix(tr(" %"))
    box.setValue(value)
    return box
