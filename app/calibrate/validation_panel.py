"""The side panel of the validation step: pressed object, true size, and result."""

from __future__ import annotations

import math
from dataclasses import dataclass

from PySide6.QtWidgets import (
    QProgressBar,
    QPushButton,
    QWidget,
)

from app.calibrate.assembly import AssemblyDrawing
from app.calibrate.step_data import Step
from app.calibrate.step_panel import WIDTH, help_button, lay_button, side_scroll
from app.calibrate.trial import Trial
from app.services.preferences import Limits
from app.widgets.fields import choice, number, switch
from app.widgets.forms import Form
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, keep_space, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.result import Truth
from gelpolight_core.translation import tr

SHAPES = {
    "cylinder": tr("Cylinder, flat end"),
    "cuboid": tr("Cuboid, flat end"),
    "ball": tr("Ball"),
}
MM, PERCENT = tr(" mm"), tr(" %")


@dataclass(frozen=True)
class Asked:
    """The pressed object, and the largest errors with which it validates the calibration."""

    shape: str = choice("cylinder", tr("Shape"), SHAPES)
    size_mm: float = number(5.0, tr("True diameter or side"), 0.01, 500.0, MM, 3, step=0.1)
    height_known: bool = switch(False, "", tr("Depth is known"))
    height_mm: float = number(
        1.0,
        tr("True depth of the press"),
        0.01,
        500.0,
        MM,
        3,
        step=0.1,
        when=lambda asked: asked.height_known,
    )
    size_limit: float = number(5.0, tr("Largest size error"), 0.1, 100.0, PERCENT, 1)
    height_limit: float = number(8.0, tr("Largest depth error"), 0.1, 100.0, PERCENT, 1)

    @property
    def known(self) -> Truth:
        """The object."""
        height = self.height_mm if self.height_known else math.nan
        return Truth(self.shape, self.size_mm, height)


class ValidationPanel(QWidget):
    """Asks for the known object, and shows the result of the trial."""

    def __init__(self, step: Step, limits: Limits) -> None:
        super().__init__()
        asked = Asked(size_limit=limits.size_percent, height_limit=limits.height_percent)
        self.form = Form(asked, "validation", at_once=True)
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
        task = PlainLabel(step.task, wrap=True)
        self.calibration = named(
            PlainLabel(wrap=True), "validation.calibration", tr("Calibration to validate")
        )
        self.lay = lay_button("validation.lay")
        self.measure = named(
            QPushButton(tr("&Measure the press"), minimumHeight=38),
            "validation.measure",
            tr("Measure the pressed object"),
        )
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
        keep_space(self.progress)
        self.progress.hide()
        self.result = named(MarkupLabel(wrap=True), "validation.result", tr("Result"))
        self.keep = named(
            QPushButton(tr("&Record this validation"), minimumHeight=34),
            "validation.keep",
            tr("Record this validation"),
        )
        self.verdict = named(PlainLabel(wrap=True), "validation.verdict", tr("Validated or not"))
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
            self.form,
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

    @property
    def asked(self) -> Asked:
        """The object and the limits as entered."""
        return self.form.value

    def show_known(self, known: Truth) -> None:
        """Fill in an object, for example the one on the virtual bench."""
        shape = known.shape if known.shape in SHAPES else next(iter(SHAPES))
        self.form.change(
            shape=shape,
            size_mm=known.size_mm,
            height_known=known.is_whole,
            height_mm=known.height_mm if known.is_whole else self.asked.height_mm,
        )

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
                    what=escaped(c.name.capitalize()),
                    m=c.value,
                    t=c.truth,
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
