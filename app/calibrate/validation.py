"""The validation step: an object of known size, measured with the saved calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from app.calibrate.detection import read_raw
from app.calibrate.maps import Panel, depth_panel
from app.calibrate.page_state import Remedy, StepState
from app.calibrate.result import ask_report
from app.calibrate.step import Step
from app.context.calibration_status import put_into_use
from app.services.file_dialogs import ask_open, image_patterns
from app.services.jobs import Job
from app.sources.bench import Scene
from app.widgets.buttons import push_button
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.meaning import set_property, show_meaning
from app.widgets.naming import named
from app.workspace.entries import read_entry
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.calibration.remarks import write_validation
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.measurement.press import read_truth
from gelpolight_core.measurement.trial import Trial, run_trial
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reference import LENGTHS, SHAPES, Truth
from gelpolight_core.validation import Validation

FRAMES = 4
TRUTH = "truth.csv"
ASKED = ("shape", *LENGTHS)


class ValidationStep(Step):
    """Measures presses with the saved calibration, and records the result."""

    uses_camera = True
    guide = "guide/validate", "validate"

    key, title, stages = "validation", "Validation", ()
    task = (
        "Press an indenter of known size into the membrane. The calibration is validated "
        "only if the measured size conforms to the tolerance."
    )
    assembly = "indenter"
    frames = FRAMES
    button = "&Measure the press"

    _trial: Trial | None = None
    _asked: object = None
    """Identifies the newest trial; results of older ones are dropped."""
    _reconstructor: tuple[Path | None, Reconstructor | None] = None, None
    """Of the calibration at this path."""

    def build(self) -> None:
        """Create the form of the pressed object and the button that records."""
        known = Truth(size_mm=5.0)
        self.form = Form(known, "validation", only=ASKED, narrow=True)
        self.calibration = named(
            PlainLabel(wrap=True), "validation.calibration", "Calibration to validate"
        )
        asked = QWidget()
        vbox(self.form, self.calibration, of=asked, margins=0)
        self.keep = push_button("validation.keep", "&Record this validation", self.record)
        set_property(self.keep, "primary", True)
        self.own = self.panel.add_extra("Pressed object", asked), self.panel.add_foot(self.keep)
        self.context.requests.calibrations_changed.connect(self.model.changed)
        self._find_earlier()

    def focus(self) -> QWidget:
        """Return the button that measures."""
        return self.panel.capture

    # What is shown

    def state(self) -> StepState:
        """Return whether the saved calibration is validated."""
        found = self._recorded()
        if found is None:
            return "empty", "Not validated yet"
        if not self.model.saved:
            return "stale", "The captures or corrections have changed since the validation"
        if found.passed:
            return "pass", "Validated"
        if found.verdict is Verdict.WARN:
            return "warn", "The uncertainty is too large to decide"
        return "fail", "The last validation failed"

    def number(self) -> Finding | None:
        """Return the largest error of the recorded trial."""
        found = self._recorded()
        if found is None:
            return None
        return Finding("largest_error", "Largest error", found.largest_percent, "%")

    def remedies(self, state: str) -> tuple[Remedy, ...]:
        """Return what follows a validation."""
        if state != "pass":
            return ()
        if self.context.workspace.in_use != self.model.saved_path:
            use = partial(put_into_use, self.model.saved_path, self.area, context=self.context)
            return (("&Use it now", use),)
        page = self.context.requests.page
        return (
            ("&Inspect", partial(page.emit, "inspect")),
            ("M&easure", partial(page.emit, "measure")),
            ("&Report…", partial(ask_report, self)),
        )

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the measured depth."""
        if self._trial is None:
            return ()
        outline_mm = self._trial.measurement.outline_mm
        return (depth_panel("Measured depth", self._trial.heightmap, outline_mm),)

    def refresh(self) -> None:
        """Show which calibration is validated; a trial belongs to one of them."""
        path, present = self.model.saved_path, bool(self.model.saved)
        text = "Calibration: {name}, computed from the present captures."
        if path is None:
            text = "Save the calibration first. A validation belongs to a saved calibration."
        elif not present:
            text = (
                "Calibration: {name}. Its captures or corrections have changed since. Save it "
                "again."
            )
        self.calibration.setVisible(not present)
        self.calibration.setText(text.format(name=path and path.stem))
        show_meaning(self.calibration, "" if present else "warn")
        if path != self._reconstructor[0]:
            self._reconstructor = path, None
            self._show(None)

    def on_bench(self, scene: Scene) -> None:
        """Fill in the object on the virtual bench."""
        if (known := scene.truth) is not None:
            self.show_known(known)

    def show_known(self, known: Truth) -> None:
        """Fill in an object."""
        self.form.show_value(known if known.shape in SHAPES else replace(known, shape="cylinder"))

    # The calibration

    def _find_earlier(self) -> None:
        """Select the calibration of the present captures, or the newest one of the session."""
        project = self.project
        session, present = project.session, project.all_inputs
        try:
            entries = self.context.workspace.entries()
        except InputError as error:
            self.context.toasts.show(str(error), "warn")
            return
        found = [
            (entry.summary.inputs != present, entry.path)
            for entry in entries
            if entry.summary is not None
            and entry.summary.session == session.folder.name
            and entry.serial == session.serial
        ]
        if found:
            self.model.use_calibration(min(found, key=lambda one: one[0])[1])

    def _recorded(self) -> Validation | None:
        path = self.model.saved_path
        return None if path is None else read_entry(path).validation

    # Trials

    def capture(self) -> None:
        """Capture the press, then measure it."""
        live, fault = self.model.live, self.model.camera.fault()
        if fault:
            self._refuse(fault)
        elif live.stream is not None and not live.capturing:
            self._show(None)
            self.model.show_live("Capturing: hold the object still.", ready=True)
            live.capture(FRAMES, self._measure, self._refuse)

    def choose_files(self) -> None:
        """Let the user choose the image of a press, and measure it."""
        presses, settings = self.session.folder / "presses", self.context.settings
        if presses.is_dir():
            settings.keep_folder("press", presses)
        title, patterns = "Import an image of a press", image_patterns()
        path = ask_open(self.area, settings, "press", title, patterns)
        if path is not None:
            self.import_press(path)

    def import_press(self, path: Path) -> None:
        """Measure a press from an image file, with the true size from its folder, if given."""
        try:
            frame = read_raw(path)
            known = _known_in_folder(path)
        except InputError as error:
            self._refuse(str(error))
            return
        if known is not None:
            self.show_known(known)
        self._measure([frame])

    def _measure(self, frames: list[NDArray[Any]]) -> None:
        self._show(None)
        known, asked = self.form.value, self._asked
        path, present = self.model.saved_path, self._reconstructor[1]
        if path is None:
            self._refuse(self.calibration.text())
            return

        def work(_progress: Callable[[float], None]) -> tuple[Reconstructor, Trial]:
            reconstructor = present or Reconstructor(read_calibration(path))
            limits = self.context.settings.limits.percent
            return reconstructor, run_trial(frames, reconstructor, known, limits)

        def done(found: tuple[Reconstructor, Trial]) -> None:
            if self._asked is asked:
                self._reconstructor = path, found[0]
                self.show_trial(found[1])

        def failed(sentence: str) -> None:
            if self._asked is asked:
                self._refuse(sentence)

        self.model.show_live("Measuring.", ready=True)
        # Beside the computations: a press can be measured while the stages are computed again.
        self.model.short_jobs.submit(Job("Measuring the press", work, done, failed))

    def show_trial(self, trial: Trial) -> None:
        """Show the result of a trial."""
        self._show(trial, *trial.shown())

    def _refuse(self, sentence: str) -> None:
        self._show(None, sentence, "warn")

    def _show(self, trial: Trial | None, sentence: str = "", role: str = "pass") -> None:
        """Show how the newest trial ended, with its depth, unless another step is open."""
        self._trial, self._asked = trial, object()
        self.keep.setEnabled(trial is not None and trial.recordable)
        if self.model.page.step is self:
            panels = self.result_panels()
            self.model.update_page(notice=(sentence, role), live=("", "pass"), panels=panels)
            self.area.result.setChecked(bool(panels))

    def record(self) -> None:
        """Store the trial as the validation of the calibration."""
        path = self._reconstructor[0]
        if self._trial is None or path is None:
            return
        validation = self._trial.validation
        try:
            write_validation(validation, path)
        except InputError as error:
            self.model.show_notice(str(error), "fail")
            return
        self.model.show_notice("", "pass")
        self.context.requests.calibrations_changed.emit()
        self.panel.reveal_message()


def _known_in_folder(path: Path) -> Truth | None:
    """Return the object given for a press image in the truth.csv of its folder, or None.

    Raises
    ------
    InputError
        If the file cannot be used.
    """
    if not (path.parent / TRUTH).is_file():
        return None
    return next((r.truth for r in read_truth(path.parent).rows if r.file == path.name), None)
