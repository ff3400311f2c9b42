"""The side panel of the validation step: pressed object, true size, and result."""

from __future__ import annotations

from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFormLayout,
    QProgressBar,
    QPushButton,
    QWidget,
)

from app.calibrate.assembly import AssemblyDrawing
from app.calibrate.step_data import Step
from app.calibrate.step_panel import WIDTH, help_button, lay_button, side_scroll
from app.calibrate.trial import KnownObject, Trial
from app.widgets.inputs import ComboBox, DoubleSpinBox
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr


class ValidationPanel(QWidget):
    """Asks for the known object, and shows the result of the trial."""

    def __init__(self, step: Step, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "validation", tr("Validation"))
        self.setFixedWidth(WIDTH)
        self._has_calibration = self._has_camera = False
        scroll, inside = side_scroll("validation.scroll", tr("Validation"))
        vbox(scroll, of=self, margins=0)
        title = PlainLabel(step.title)
        make_bold(title, size=1.35)
        self.help = help_button("validation.help")
        head = hbox((title, 1), self.help)
        assembly = AssemblyDrawing()
        assembly.show_assembly(step.assembly)
        task = PlainLabel(step.task)
        task.setWordWrap(True)
        self.calibration = named(
            PlainLabel(), "validation.calibration", tr("Calibration to validate")
        )
        self.calibration.setWordWrap(True)
        self.lay = lay_button("validation.lay")
        self.measure = named(
            QPushButton(tr("&Measure the press")),
            "validation.measure",
            tr("Measure the pressed object"),
        )
        self.measure.setMinimumHeight(38)
        self.import_press = named(
            QPushButton(tr("&Import…")),
            "validation.import",
            tr("Measure a press from an image file"),
            tr("The true size is read from a truth.csv file in the same folder, if there is one"),
        )
        row = hbox((self.measure, 2), (self.import_press, 1))
        self.blocked = named(PlainLabel(), "validation.blocked", tr("Why nothing can be measured"))
        self.blocked.setWordWrap(True)
        self.progress = named(QProgressBar(), "validation.progress", tr("Progress"))
        self.progress.setRange(0, 100)
        keep = self.progress.sizePolicy()
        keep.setRetainSizeWhenHidden(True)
        self.progress.setSizePolicy(keep)
        self.progress.hide()
        self.result = named(MarkupLabel(), "validation.result", tr("Result"))
        self.result.setWordWrap(True)
        self.keep = named(
            QPushButton(tr("&Record this validation")),
            "validation.keep",
            tr("Record this validation"),
        )
        self.keep.setMinimumHeight(34)
        self.verdict = named(PlainLabel(), "validation.verdict", tr("Validated or not"))
        self.verdict.setWordWrap(True)
        make_bold(self.verdict)
        self.use = named(
            QPushButton(tr("&Use it now")),
            "validation.use",
            tr("Use the validated calibration"),
            tr("Use this calibration on the Inspect and Measure pages"),
        )
        vbox(
            head,
            assembly,
            task,
            self.calibration,
            self._build_form(),
            self.lay,
            row,
            self.blocked,
            self.progress,
            self.result,
            self.keep,
            self.verdict,
            self.use,
            None,
            of=inside,
            margins=(12, 10, 12, 10),
        )
        self.show_trial(None)

    def _build_form(self) -> QFormLayout:
        form = QFormLayout()
        self.shape = named(ComboBox(), "validation.shape", tr("Shape"))
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
        self.size_limit = _percent("validation.size_limit", tr("Size limit"), 5.0)
        self.height_limit = _percent("validation.height_limit", tr("Depth limit"), 8.0)
        form.addRow(tr("Shape"), self.shape)
        form.addRow(tr("True diameter or side"), self.size)
        form.addRow(self.height_known, self.height)
        form.addRow(tr("Largest size error"), self.size_limit)
        form.addRow(tr("Largest depth error"), self.height_limit)
        return form

    def known(self) -> KnownObject:
        """Return the object as entered."""
        height = self.height.value() if self.height_known.isChecked() else None
        return KnownObject(self.shape.currentData(), self.size.value(), height)

    def show_known(self, known: KnownObject) -> None:
        """Fill in an object, for example the one on the virtual bench."""
        self.shape.setCurrentIndex(max(self.shape.findData(known.shape), 0))
        self.size.setValue(known.size_mm)
        self.height_known.setChecked(known.height_mm is not None)
        if known.height_mm is not None:
            self.height.setValue(known.height_mm)

    def show_calibration(self, name: str, *, present: bool) -> None:
        """Show which calibration is validated.

        Parameters
        ----------
        name : str
            Its name; empty if none is saved yet.
        present : bool
            Whether it was computed from the present captures and corrections.
        """
        text = tr("Calibration: {name}, computed from the present captures.")
        if not name:
            text = tr("Save the calibration first. A validation belongs to a saved calibration.")
        elif not present:
            text = tr(
                "Calibration: {name}. Its captures or corrections have changed since. Save it "
                "again."
            )
        self.calibration.setText(text.format(name=name))
        show_meaning(self.calibration, "" if present else "warn")
        self._has_calibration = bool(name)
        self._allow()

    def show_camera(self, there: bool) -> None:
        """Enable measuring only if there is a camera."""
        self._has_camera = there
        self._allow()

    def _allow(self) -> None:
        self.measure.setEnabled(self._has_calibration and self._has_camera)
        self.import_press.setEnabled(self._has_calibration)
        why = ""
        if self._has_calibration and not self._has_camera:
            why = tr("No camera. Select one in the bar above, or import an image.")
        self.blocked.setText(why)
        self.blocked.setVisible(bool(why))

    def show_work(self, share: float | None) -> None:
        """Show the progress; None if nothing is running."""
        self.progress.setVisible(share is not None)
        self.progress.setValue(round(100 * (share or 0.0)))

    def show_trial(self, trial: Trial | None) -> None:
        """Show the result of a trial."""
        sure = trial is not None and trial.measurement.verdict == "ok"
        passed = trial is not None and all(c.passed for c in trial.comparisons)
        # A failed trial may be recorded, too, but nothing doubtful validates a calibration.
        self.keep.setEnabled(trial is not None and (sure or not passed))
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
        if not sure:
            text = tr("Low confidence: {reason}").format(reason=trial.measurement.reason)
            rows.append(escaped(text))
            if passed:
                again = tr("It cannot be recorded. Correct this, then press again.")
                rows.append(escaped(again))
        meaning = "pass" if passed else "fail"
        self._show_result("<br>".join(rows), meaning if sure else "warn")

    def say(self, sentence: str, meaning: str = "") -> None:
        """Show how a trial is progressing, or why it failed."""
        self._show_result(escaped(sentence), meaning)

    def _show_result(self, markup: str, meaning: str) -> None:
        self.result.setText(markup)
        show_meaning(self.result, meaning)

    def show_verdict(self, text: str, *, passed: bool, may_use: bool = False) -> None:
        """Show whether the calibration is validated, and offer to use it."""
        self.use.setVisible(may_use)
        self.verdict.setText(text)
        show_meaning(self.verdict, "pass" if passed else "fail")


def _length(name: str, accessible: str, value: float) -> QDoubleSpinBox:
    box = named(DoubleSpinBox(), name, tr("{what} in mm").format(what=accessible))
    box.setDecimals(3)
    box.setRange(0.01, 500.0)
    box.setSingleStep(0.1)
    box.setSuffix(tr(" mm"))
    box.setValue(value)
    return box


def _percent(name: str, accessible: str, value: float) -> QDoubleSpinBox:
    box = named(DoubleSpinBox(), name, tr("{what} in percent").format(what=accessible))
    box.setDecimals(1)
    box.setRange(0.1, 100.0)
    box.setSuffix(tr(" %"))
    box.setValue(value)
    return box
