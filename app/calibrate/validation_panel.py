"""The side panel of the validation step: pressed object, true size, and result."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtWidgets import QFrame, QProgressBar, QPushButton, QWidget

from app.calibrate.step_data import Step
from app.calibrate.step_panel import WIDTH, help_button, lay_button, side_scroll
from app.calibrate.trial import Trial
from app.widgets.buttons import push_button
from app.widgets.fields import choice, number
from app.widgets.forms import Form
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, keep_space, vbox
from app.widgets.meaning import make_bold, set_property, show_meaning
from app.widgets.naming import named
from gelpolight_core.measurement.result import Truth
from gelpolight_core.translation import tr

SHAPES = {
    "cylinder": tr("Cylinder, flat end"),
    "cuboid": tr("Cuboid, flat end"),
    "ball": tr("Ball"),
}
MM = tr(" mm")


@dataclass(frozen=True)
class Asked:
    """The pressed object; a height of 0 is not known."""

    shape: str = choice("cylinder", tr("Shape"), SHAPES)
    size_mm: float = number(5.0, tr("True diameter or side"), 0.01, 500.0, MM, 3, step=0.1)
    height_mm: float = number(
        0.0, tr("True depth of the press"), 0.0, 500.0, MM, 3, step=0.1, none=tr("not known")
    )

    @property
    def known(self) -> Truth:
        """The object."""
        return Truth(self.shape, self.size_mm, self.height_mm or math.nan)


class ValidationPanel(QWidget):
    """Asks for the known object, and shows the result of the trial.

    Parameters
    ----------
    step : Step
        The step.
    after : tuple of (str, str, callable)
        Name, text and action of the buttons that follow a validation.
    """

    def __init__(
        self, step: Step, after: tuple[tuple[str, str, Callable[[], object]], ...]
    ) -> None:
        super().__init__()
        self.form = Form(Asked(), "validation", at_once=True)
        named(self, "validation", tr("Validation"))
        self.setFixedWidth(WIDTH)
        self._has_calibration = self._has_camera = False
        title = PlainLabel(step.title)
        make_bold(title, size=1.5)
        self.help = help_button("validation.help")
        task = PlainLabel(step.task, wrap=True)
        self.calibration = named(
            PlainLabel(wrap=True), "validation.calibration", tr("Calibration to validate")
        )
        self.result = named(MarkupLabel(wrap=True), "validation.result", tr("Result"))
        self.verdict = named(PlainLabel(wrap=True), "validation.verdict", tr("Validated or not"))
        make_bold(self.verdict, size=1.2)
        self.use = named(
            QPushButton(tr("&Use it now")),
            "validation.use",
            tr("Use the validated calibration"),
            tr("Use this calibration on the Inspect and Measure pages"),
        )
        self.after = QWidget()
        buttons = (push_button(f"validation.{name}", text, act) for name, text, act in after)
        vbox(*buttons, of=self.after, margins=0, spacing=8)
        object_card, result_card = (named(QFrame(), "card", tr("Pressed object")) for _ in range(2))
        vbox(self.form, of=object_card, margins=12)
        vbox(self.verdict, self.result, self.use, self.after, of=result_card, margins=12, spacing=8)
        scroll, inside = side_scroll("validation.scroll", tr("Validation"))
        parts = hbox((title, 1), self.help), task, self.calibration, object_card, result_card
        vbox(*parts, None, of=inside, margins=(16, 16, 16, 8), spacing=12)
        vbox((scroll, 1), self._build_foot(), of=self, margins=0, spacing=0)
        self.show_trial(None)

    def _build_foot(self) -> QWidget:
        self.lay = lay_button("validation.lay")
        self.measure = named(
            QPushButton(tr("&Measure the press")),
            "validation.measure",
            tr("Measure the pressed object"),
        )
        self.import_press = named(
            QPushButton(tr("&Import…")),
            "validation.import",
            tr("Measure a press from an image file"),
            tr("The true size is read from a truth.csv file in the same folder, if there is one"),
        )
        self.keep = named(
            QPushButton(tr("&Record this validation")),
            "validation.keep",
            tr("Record this validation"),
        )
        for button in (self.measure, self.import_press, self.keep):
            button.setMinimumHeight(36)
        self.progress = named(QProgressBar(), "validation.progress", tr("Progress"))
        self.progress.setRange(0, 100)
        keep_space(self.progress)
        self.progress.hide()
        foot, row = QWidget(), hbox((self.measure, 2), (self.import_press, 1), spacing=8)
        parts = self.progress, self.lay, row, self.keep
        vbox(*parts, of=foot, margins=(16, 8, 16, 16), spacing=8)
        return foot

    @property
    def asked(self) -> Asked:
        """The object as entered."""
        return self.form.value

    def show_known(self, known: Truth) -> None:
        """Fill in an object, for example the one on the virtual bench."""
        shape = known.shape if known.shape in SHAPES else next(iter(SHAPES))
        height_mm = known.height_mm if known.is_whole else 0.0
        self.form.change(shape=shape, size_mm=known.size_mm, height_mm=height_mm)

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
        self._has_calibration, self._calibration = bool(name), text.format(name=name)
        show_meaning(self.calibration, "" if present else "warn")
        self._allow()

    _calibration = ""

    def show_camera(self, there: bool) -> None:
        """Enable measuring only if there is a camera."""
        self._has_camera = there
        self._allow()

    def _allow(self) -> None:
        self.measure.setEnabled(self._has_calibration and self._has_camera)
        self.import_press.setEnabled(self._has_calibration)
        text = self._calibration
        if self._has_calibration and not self._has_camera:
            text += " " + tr("No camera. Select one in the bar above, or import an image.")
        self.calibration.setText(text)

    def show_work(self, share: float | None) -> None:
        """Show the progress; None if nothing is running."""
        self.progress.setVisible(share is not None)
        self.progress.setValue(round(100 * (share or 0.0)))

    def show_trial(self, trial: Trial | None) -> None:
        """Show the result of a trial."""
        sure = trial is not None and trial.measurement.verdict == "ok"
        passed = trial is not None and all(c.passed for c in trial.comparisons)
        # A failed trial may be recorded, too, but nothing doubtful validates a calibration.
        self._show_main(recording=trial is not None and (sure or not passed))
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

    def _show_main(self, *, recording: bool) -> None:
        """Make what comes next the main button."""
        self.keep.setEnabled(recording)
        set_property(self.keep, "primary", recording)
        set_property(self.measure, "primary", not recording)

    def say(self, sentence: str, role: str = "") -> None:
        """Show how a trial is progressing, or why it failed."""
        self._show_result(escaped(sentence), role)

    def _show_result(self, markup: str, meaning: str) -> None:
        self.result.setText(markup)
        self.result.setVisible(bool(markup))
        show_meaning(self.result, meaning)

    def show_verdict(self, text: str, role: str, *, used: bool) -> None:
        """Show whether the calibration is validated, with what follows if it is in use."""
        passed = role == "pass"
        self.use.setVisible(passed and not used)
        self.after.setVisible(passed and used)
        self.verdict.setText(text)
        show_meaning(self.verdict, role)
        if passed:
            set_property(self.measure, "primary", False)
